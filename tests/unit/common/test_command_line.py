"""Command lines: which values are taken, and the line for anything else."""

import subprocess
import sys
import tomllib
from collections.abc import Callable
from datetime import datetime
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal

import pytest
import typer

from common.command_line import read_plainly

ROOT = Path(__file__).parents[3]
PROGRAMS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]


class Word(Enum):
    FIRST = "first"
    SECOND = "second"


@pytest.fixture
def show() -> Callable[..., str]:
    app = typer.Typer()

    @app.command()
    def show(
        *,
        word: Word = Word.FIRST,
        literal: Literal["one", "two"] = "one",
        number: Annotated[int, typer.Option(min=1, max=9)] = 1,
        path: Path = Path("here"),
        profile: Literal["low-bw", "balanced"] = "balanced",
        begins: datetime | None = None,
        host: list[str] | None = None,
        flag: Annotated[bool, typer.Option("--flag", envvar="SHOW_FLAG")] = False,
    ) -> None:
        shown.append(f"{word} {literal} {number} {path} {profile} {begins} {host}" + " flag" * flag)

    shown: list[str] = []
    command = typer.main.get_command(app)
    read_plainly(command)

    def run(*words: str) -> str:
        command.main(list(words), standalone_mode=False)
        return shown[-1]

    return run


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ([], "Word.FIRST one 1 here balanced None None"),
        (["--word", "second"], "Word.SECOND one 1 here balanced None None"),
        (["--literal", "two", "--number", "9", "--path", "a/b"], "Word.FIRST two 9 a/b balanced None None"),
        (["--profile", "LOW_BW"], "Word.FIRST one 1 here low-bw None None"),
        (
            ["--profile", "low_bw", "--host", "a", "--host", "b"],
            "Word.FIRST one 1 here low-bw None ['a', 'b']",
        ),
        (["--begins", "2026-11-22"], "Word.FIRST one 1 here balanced 2026-11-22 00:00:00 None"),
    ],
)
def test_values_have_their_type(show: Callable[..., str], words: list[str], shown: str) -> None:
    assert show(*words) == shown


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--word", "third"], "'third' is not one of first, second"),
        (["--literal", "three"], "'three' is not one of one, two"),
        (["--number", "10"], "'10' is not a whole number from 1 to 9"),
        (["--number", "x"], "'x' is not a whole number from 1 to 9"),
        (["--profile", "lobw"], "'lobw' is not one of low-bw, balanced. Did you mean low-bw[?]"),
        (["--begins", "soon"], "'soon' is not a time in UTC, 2026-11-22 or 2026-11-22T09:30 for example"),
        (["--begins", "2026-11-22T09:30+02:00"], "is not a time in UTC"),
    ],
)
def test_anything_else_is_refused(show: Callable[..., str], words: list[str], expected: str) -> None:
    with pytest.raises(typer.BadParameter, match=expected):
        show(*words)


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_program_reports_a_wrong_command_line_in_one_line(program: str) -> None:
    command = {"simrobot": "control", "robotctl": "status"}.get(program, "check")
    for words, problem in (
        (["chekc"], "No such command 'chekc'"),
        ([command, "--prnit"], "No such option: --prnit"),
    ):
        ended = subprocess.run(
            [Path(sys.executable).parent / program, *words], capture_output=True, text=True, check=False
        )
        assert ended.returncode == 2
        (line,) = ended.stderr.splitlines()
        assert line.startswith(f"error: {problem}")
        assert line.endswith(" --help")


def test_an_option_that_was_probably_meant_is_named() -> None:
    ended = subprocess.run(
        [Path(sys.executable).parent / "robot-preview", "check", "--pirnt"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert "Did you mean --print? Type: robot-preview check --help" in ended.stderr


@pytest.mark.parametrize(("value", "flag"), [("true", True), ("True", True), ("false", False), ("", False)])
def test_an_environment_variable_sets_a_flag(
    show: Callable[..., str], monkeypatch: pytest.MonkeyPatch, value: str, flag: bool
) -> None:
    monkeypatch.setenv("SHOW_FLAG", value)
    assert show().endswith("flag") is flag
    assert show("--flag").endswith("flag")


def test_an_environment_variable_that_is_no_flag_is_named(
    show: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SHOW_FLAG", "maybe")
    with pytest.raises(typer.BadParameter, match="'maybe' is not one of true, false"):
        show()
