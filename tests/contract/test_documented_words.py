"""Commands and options that the documents name are those of the programs and scripts."""

import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.core import TyperGroup

from bridge.cli import app as bridge_app
from console.cli.app import command_line
from console.cli.lazy import LazyCommand
from drive.cli import app as drive_app
from gateway.cli import app as gateway_app
from hub.cli import app as hub_app
from preview.cli import app as preview_app
from recorder.cli import app as recorder_app
from simrobot.cli import app as simrobot_app
from tap.cli import app as tap_app
from tests.support.documented_commands import ROOT, blocks, typed

PAGES = sorted(path.relative_to(ROOT) for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
HISTORY = Path("CHANGELOG.md")
APPS = {
    "robot-bridge": bridge_app,
    "robot-drive": drive_app,
    "robot-gateway": gateway_app,
    "robot-preview": preview_app,
    "robot-recorder": recorder_app,
    "robot-tap": tap_app,
    "simrobot": simrobot_app,
}
PROGRAM = re.compile(rf"(?<![\w/.-])(robotctl|{'|'.join(APPS)}) ([^|;&<>()\n]*)")
WORD = re.compile(r"[a-z][a-z-]+")
OPTION = re.compile(r"--[a-z][\w.-]*")
ANY_ROBOT = {"--target", "--robot", "--json", "--hub", "--help"}
"""Options that the page describes below the synopsis, because many commands have them."""
SCRIPT = re.compile(r"(?:[\w.~/-]*/)?((?:scripts|docker)/[\w-]+(?:\.sh)?)")
PARTS = {
    "scripts/bench": "bench/__main__.py",
    "scripts/demo": "scripts/demo_program/__main__.py",
    "scripts/fleet-demo": "scripts/fleet_demo/__main__.py",
    "scripts/fuzz": "fuzz/__main__.py",
    "scripts/release": "scripts/release_program/__main__.py",
}
"""Where the options of scripts are read that only start a program."""
WITH_COMMANDS = {"scripts/images", "docker/engine"}
PASSES_ON = {"scripts/test": {"--on-request"}}
"""Options of other programs: tests/support/on_request.py has pytest's."""
SEPARATOR = re.compile(r"[|;&<>()]+")


@cache
def program(name: str) -> Any:
    if name == "robotctl":
        return command_line()
    command = typer.main.get_command(APPS[name])
    if name == "robot-bridge":
        # It passes these words on to the hub's administration, which a robot does not have.
        hub = typer.main.get_command(hub_app)
        assert isinstance(command, TyperGroup)
        assert isinstance(hub, TyperGroup)
        command.commands.update(hub=hub, enroll=hub.commands["enroll"])
    return command


def options(command: Any) -> set[str]:
    context = typer.Context(command)
    parameters = command.get_params(context)
    return {each for parameter in parameters for each in (*parameter.opts, *parameter.secondary_opts)}


def problem(name: str, words: list[str]) -> str:
    """What of a command line does not exist; empty where all does."""
    command = program(name)
    known = options(command) | {"--help", "--install-completion", "--show-completion"}
    for word in words:
        if isinstance(command, TyperGroup) and WORD.fullmatch(word):
            if word not in command.commands:
                return f"{name} has no command {word}"
            command = command.commands[word]
            command = command.load() if isinstance(command, LazyCommand) else command
            known |= options(command)
        elif word.startswith("--") and word.partition("=")[0] not in known:
            return f"{name} has no option {word}"
    return ""


def documented(page: Path) -> list[tuple[str, list[str]]]:
    found = []
    for text in typed(str(page)):
        # To systemctl the names are units, which have no commands.
        if "systemctl" not in text:
            found += [(name, rest.split()) for name, rest in PROGRAM.findall(text)]
    return found


@pytest.mark.parametrize("page", [page for page in PAGES if page != HISTORY], ids=str)
def test_what_a_page_names_exists(page: Path) -> None:
    problems = [found for name, words in documented(page) if (found := problem(name, words))]
    assert problems == []


def leaves(
    command: Any, apart: set[str], path: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], set[str]]]:
    """Yields each command of a program that does something, with its options but for those apart."""
    command = command.load() if isinstance(command, LazyCommand) else command
    within = command.commands if isinstance(command, TyperGroup) else {}
    for name, each in within.items():
        yield from leaves(each, apart, (*path, name))
    if path and (not within or command.invoke_without_command):
        yield path, {each for each in options(command) if each.startswith("--")} - apart


def synopsis() -> dict[tuple[str, ...], set[str]]:
    """The commands of docs/robotctl.md's synopsis, with their options; some take two lines."""
    (text,) = (block.text for block in blocks("docs/robotctl.md") if "synopsis" in block.reason)
    lines = re.sub(r"\n {40,}(?=\[)", " ", text).replace("[--json] ", "[--json]\n").splitlines()
    found: dict[tuple[str, ...], set[str]] = defaultdict(set)
    for line in lines[1:]:
        command: list[list[str]] = []
        for word in line.split():
            alternatives = word.split("|")
            if not all(map(WORD.fullmatch, alternatives)):
                break
            command.append(alternatives)
        for path in product(*command):
            found[path] |= set(OPTION.findall(line))
    return dict(found)


def test_the_synopsis_names_every_command_and_option() -> None:
    assert synopsis() == dict(leaves(command_line(), ANY_ROBOT))


def test_the_table_of_credentials_names_every_command_and_option() -> None:
    page = (ROOT / "docs/security.md").read_text(encoding="utf-8")
    table = page.partition("| command | does |\n|---|---|\n")[2].partition("\n\n")[0]
    found: dict[tuple[str, ...], set[str]] = defaultdict(set)
    for usage, does in (line.split(" | ", 1) for line in table.splitlines()):
        for span in re.findall(r"`([^`]+)`", usage):
            # Options that other options or commands are compared with stand alone in the text.
            found[span.split()[0],] |= {*OPTION.findall(span), *re.findall(r"`(--[a-z-]+)`", does)}
    assert "All of them take `--config F` or `--directory DIR`" in page
    credentials = program("robot-gateway").commands["credentials"]
    assert found == dict(leaves(credentials, {"--config", "--directory", "--help"}))


def test_the_readme_lists_every_program_with_its_commands() -> None:
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    table = page.partition("| command | does |\n|---|---|\n")[2].partition("\n\n")[0]
    listed: dict[str, set[str]] = {}
    for row in table.splitlines():
        name, commands = row.removeprefix("| `").partition("`")[0].split(" ", 1)
        # Of a group, the commands on their own: preview on.
        listed[name] = {command.split()[0] for command in commands.split(" \\| ")}
    assert listed == {
        name: {word for word, command in program(name).commands.items() if not command.hidden}
        for name in (*APPS, "robotctl")
    }


@cache
def text_of(script: str) -> str:
    return (ROOT / PARTS.get(script, script)).read_text(encoding="utf-8")


def has(script: str, word: str) -> bool:
    """Whether a script's text has the word, as a whole."""
    return bool(re.search(rf"(?<![\w-]){re.escape(word)}(?![\w-])", text_of(script)))


def problems_of_scripts(text: str) -> Iterator[str]:
    """Yields what of the scripts in a line does not exist."""
    for command in SEPARATOR.split(text):
        script, first = "", False
        for word in command.split():
            if found := SCRIPT.fullmatch(word):
                script, first = found[1], True
                if not (ROOT / script).exists():
                    yield f"there is no {script}"
                    script = ""
                continue
            if not script or (ROOT / script).is_dir():
                continue
            option = word.partition("=")[0]
            if OPTION.fullmatch(option):
                if option not in PASSES_ON.get(script, ()) and not has(script, option):
                    yield f"{script} has no option {option}"
            elif first and script in WITH_COMMANDS and WORD.fullmatch(word) and not has(script, word):
                yield f"{script} has no command {word}"
            first = False


@pytest.mark.parametrize("page", [page for page in PAGES if page != HISTORY], ids=str)
def test_the_scripts_of_a_page_exist_with_their_options(page: Path) -> None:
    assert [problem for text in typed(str(page)) for problem in problems_of_scripts(text)] == []


def test_what_does_not_exist_is_noticed() -> None:
    assert problem("robotctl", ["statsu"])
    assert problem("robotctl", ["preview", "on", "--bandwidth", "low"])
    assert problem("robot-gateway", ["credentials", "ad"])
    assert problem("robot-bridge", ["hub", "enrol"])
    assert problem("robot-drive", ["doctor", "--puls"])
    assert not problem("robotctl", ["--robot", "lab2", "preview", "on", "--profile", "low-bw"])
    for wrong in (
        "sudo scripts/install-robt",
        "git pull && tree/scripts/install-console --without-vido",
        "scripts/images bild",
        "docker/debian-13 scripts/test --shrt",
        "scripts/release 1.0 --without-image",
    ):
        assert list(problems_of_scripts(wrong)), wrong
    assert not list(problems_of_scripts("docker/debian-13 scripts/test --short"))
