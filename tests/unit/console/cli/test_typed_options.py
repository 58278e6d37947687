"""Commands in remedies are for the robot of the command line that they answer."""

from pathlib import Path

import pytest

from console.cli.app import COMMANDS
from console.cli.typed_options import typed_options

LOGIN = "type: robotctl login NAME HOST:PORT FILE"
FOR_NO_ROBOT = {"login", "robots", "fleet", "practice"}
"""Or they name it themselves."""
KNOWN = """
default = "lab1"
[robots.lab1]
target = "lab1.local"
[robots.lab2]
target = "10.0.0.2:50052"
"""


@pytest.fixture(autouse=True)
def known_robots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    (tmp_path / "robotctl").mkdir()
    (tmp_path / "robotctl/config.toml").write_text(KNOWN)


@pytest.mark.parametrize(
    ("words", "repeated"),
    [
        ("status", "Type: robotctl status"),
        ("--robot lab2 status", "Type: robotctl --robot lab2 status"),
        ("preview on --target=10.0.0.9", "Type: robotctl --target 10.0.0.9 status"),
        ("--robot lab2 status --target 10.0.0.9", "Type: robotctl --target 10.0.0.9 --robot lab2 status"),
        ("--robot lab1 status --robot lab2", "Type: robotctl --robot lab2 status"),
        ("status --robot", "Type: robotctl status"),
    ],
)
def test_the_robot_is_repeated(words: str, repeated: str) -> None:
    assert typed_options(words.split()).repeated_in("Type: robotctl status") == repeated


@pytest.mark.parametrize("command", sorted({*COMMANDS, "record"} - FOR_NO_ROBOT))
def test_every_command_for_a_robot_gets_it(command: str) -> None:
    text = typed_options(["--robot", "lab2", "doctor"]).repeated_in(f"Type: robotctl {command}")
    assert text == f"Type: robotctl --robot lab2 {command}"


def test_commands_that_are_for_no_robot_stay() -> None:
    typed = typed_options(["--robot", "lab2", "status"])
    for text in ("Type: robotctl robots add lab3 HOST:PORT", "robotctl starts", ""):
        assert typed.repeated_in(text) == text


@pytest.mark.parametrize(
    ("words", "name_and_address"),
    [
        ("status", "lab1 lab1.local:50051"),
        ("--robot lab2 status", "lab2 10.0.0.2:50052"),
        ("--robot lab2 --target localhost:7 status", "lab2 localhost:7"),
        ("--target localhost:7 status", "NAME localhost:7"),
        ("--robot lab9 status", "NAME HOST:PORT"),
        ("login lab5 10.0.0.5:50051 anna.login", "lab5 10.0.0.5:50051"),
        ("login", "lab1 lab1.local:50051"),
    ],
)
def test_a_login_has_what_is_known_of_the_robot(words: str, name_and_address: str) -> None:
    expected = f"type: robotctl login {name_and_address} FILE"
    assert typed_options(words.split()).repeated_in(LOGIN) == expected
