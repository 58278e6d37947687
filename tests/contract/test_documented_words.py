"""Commands and options that the documents name are those of the programs."""

import re
from functools import cache
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
from tests.support.documented_commands import ROOT, blocks

PAGES = sorted(path.relative_to(ROOT) for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
HISTORY = Path("CHANGELOG.md")
SPAN = re.compile(r"`([^`\n]+)`")
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
    text = (ROOT / page).read_text(encoding="utf-8")
    spans = SPAN.findall(text)
    commands = [block for block in blocks(str(page)) if "synopsis" not in block.reason]
    pasted = [line for block in commands for line in block.text.splitlines()]
    found = []
    for source in (*spans, *(line.partition(" #")[0] for line in pasted)):
        text = source.replace("\\|", "|")
        # To systemctl the names are units, which have no commands.
        if "systemctl" not in text:
            found += [(name, rest.split()) for name, rest in PROGRAM.findall(text)]
    return found


@pytest.mark.parametrize("page", [page for page in PAGES if page != HISTORY], ids=str)
def test_what_a_page_names_exists(page: Path) -> None:
    problems = [found for name, words in documented(page) if (found := problem(name, words))]
    assert problems == []


def test_the_synopsis_names_every_command_and_option() -> None:
    (synopsis,) = (block.text for block in blocks("docs/robotctl.md") if "synopsis" in block.reason)
    lines = re.sub(r"\n {40,}(?=\[)", " ", synopsis).replace("[--json] ", "[--json]\n").splitlines()
    named: set[tuple[str, ...]] = set()
    for line in lines[1:]:
        words = [word for word in line.split("[")[0].split() if WORD.fullmatch(word)]
        words = words or line.split()[:1]
        for last in re.findall(r"[a-z]+\|[a-z]+", line.split("[")[0])[:1]:
            named |= {(words[0], each) for each in last.split("|")}
        named.add(tuple(words))
        given = re.findall(r"--[a-z-]+", line)
        assert problem("robotctl", [*words, *given]) == "", line
    assert {words[0] for words in named} == set(command_line().commands)


def test_what_does_not_exist_is_noticed() -> None:
    assert problem("robotctl", ["statsu"])
    assert problem("robotctl", ["preview", "on", "--bandwidth", "low"])
    assert problem("robot-gateway", ["credentials", "ad"])
    assert problem("robot-bridge", ["hub", "enrol"])
    assert problem("robot-drive", ["doctor", "--puls"])
    assert not problem("robotctl", ["--robot", "lab2", "preview", "on", "--profile", "low-bw"])
