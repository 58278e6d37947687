"""Completion as it is used: a shell with a keyboard, the Tab key, and what then stands on the line."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.robotctl import ENDS_WITHIN_S, ROBOTCTL, environment
from tests.support.terminal import Terminal, terminal_with
from tests.support.waiting import wait_until

TAB, CTRL_U, BELL = "\t", "\x15", "\a"
BOOK = "\n".join(f'[robots.{name}]\ntarget = "{name}.local"' for name in ("lab1", "lab2", "yard"))


@pytest.fixture
def settings(tmp_path: Path) -> dict[str, str]:
    return settings_of(tmp_path)


def settings_of(home: Path) -> dict[str, str]:
    """A person's home with three robots, and our robotctl first in the path."""
    book = home / ".config/robotctl/config.toml"
    book.parent.mkdir(parents=True)
    book.write_text(BOOK)
    # What was in there stays, and is what our prompt comes from.
    (home / ".bashrc").write_text("PS1='$ '\n")
    path = f"{ROBOTCTL.parent}:/usr/bin:/bin"
    return {"HOME": str(home), "XDG_CONFIG_HOME": str(home / ".config"), "PATH": path, "PS1": "$ "}


def run(words: list[str], settings: dict[str, str], **extra: str) -> str:
    ran = subprocess.run(
        words,
        capture_output=True,
        text=True,
        timeout=ENDS_WITHIN_S,
        env=environment(**settings, **extra),
        check=False,
    )
    assert (ran.returncode, ran.stderr) == (0, ""), ran.stderr
    return ran.stdout


@pytest.fixture(scope="module")
def completed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The .bashrc after `robotctl --install-completion`, typed in a bash."""
    home = tmp_path_factory.mktemp("home")
    with terminal_with(["bash", "--norc", "-i"], extra=settings_of(home)) as first:
        first.wait_for("$ ")
        first.press("robotctl --install-completion; echo done $?\n")
        first.wait_for("done 0")
    return home / ".bashrc"


@pytest.fixture
def bash(settings: dict[str, str], completed: Path) -> Iterator[Terminal]:
    """A new bash of someone who has installed the completion."""
    shutil.copy(completed, settings["HOME"])
    with terminal_with(["bash", "--rcfile", f"{settings['HOME']}/.bashrc", "-i"], extra=settings) as screen:
        screen.wait_for("$ ")
        yield screen


@pytest.mark.parametrize(
    ("typed", "becomes"),
    [
        ("pre", "robotctl preview "),
        ("--ro", "robotctl --robot "),
        ("--robot y", "robotctl --robot yard "),
        ("status --robot la", "robotctl status --robot lab"),
        ("preview of", "robotctl preview off "),
        ("preview on --profile h", "robotctl preview on --profile high-quality "),
        ("robots default y", "robotctl robots default yard "),
    ],
)
def test_bash_completes(bash: Terminal, typed: str, becomes: str) -> None:
    before = len(bash.read())
    bash.press(f"robotctl {typed}{TAB}")
    # Where more than one word would do, the shell rings its bell in the middle.
    wait_until(lambda: becomes in bash.read()[before:].replace(BELL, ""), f"{becomes!r} stands there")


def test_bash_lists_what_there_is(bash: Terminal) -> None:
    before = len(bash.read())
    bash.press(f"robotctl --robot {TAB}{TAB}")
    for name in ("lab1", "lab2", "yard"):
        bash.wait_for(name, after=before)


def test_a_broken_file_of_robots_does_not_break_the_line(bash: Terminal, settings: dict[str, str]) -> None:
    (Path(settings["HOME"]) / ".config/robotctl/config.toml").write_text("[robots")
    before = len(bash.read())
    bash.press(f"robotctl --robot {TAB}")
    bash.press(f"{CTRL_U}echo still here\n")
    bash.wait_for("still here\r\n", after=before)
    assert "rror" not in bash.drawn[before:]


def test_zsh_is_answered_in_its_own_words(settings: dict[str, str]) -> None:
    def ask(line: str) -> str:
        return run(["robotctl"], settings, _ROBOTCTL_COMPLETE="complete_zsh", _TYPER_COMPLETE_ARGS=line)

    assert '"preview":' in ask("robotctl pre")
    offered = ask("robotctl --robot ")
    assert offered.startswith("_arguments ")
    assert all(f'"{name}":' in offered for name in ("lab1", "lab2", "yard"))


def test_fish_is_answered_in_its_own_words(settings: dict[str, str]) -> None:
    extra = {"_ROBOTCTL_COMPLETE": "complete_fish", "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    offered = run(["robotctl"], settings, **extra, _TYPER_COMPLETE_ARGS="robotctl --robot la")
    assert offered.splitlines() == ["lab1\tlab1.local:50051", "lab2\tlab2.local:50051"]


def script_for(shell: str, settings: dict[str, str]) -> str:
    """What `robotctl --show-completion` prints when that shell asks."""
    return run([shell, "-c", "robotctl --show-completion; true"], settings)


def test_bash_gets_the_script_for_bash(settings: dict[str, str]) -> None:
    assert "complete -o default -F _robotctl_completion robotctl" in script_for("bash", settings)


@pytest.mark.skipif(not shutil.which("fish"), reason="fish is not installed")
def test_fish_completes(settings: dict[str, str]) -> None:
    script = Path(settings["HOME"]) / "robotctl.fish"
    script.write_text(script_for("fish", settings))
    offered = run(["fish", "-c", f"source {script}; complete -C 'robotctl --robot la'"], settings)
    assert [line.split("\t")[0] for line in offered.splitlines()] == ["lab1", "lab2"]


@pytest.mark.skipif(not shutil.which("zsh"), reason="zsh is not installed")
def test_zsh_completes(settings: dict[str, str]) -> None:
    script = Path(settings["HOME"]) / "_robotctl"
    script.write_text(script_for("zsh", settings))
    with terminal_with(["zsh", "-f", "-i"], extra=settings) as screen:
        screen.wait_for("$ ")
        screen.press(f"autoload -Uz compinit; compinit -u; source {script}; echo ready\n")
        place = screen.wait_for("ready\r\n")
        screen.press(f"robotctl --robot y{TAB}")
        screen.wait_for("yard", after=place)
