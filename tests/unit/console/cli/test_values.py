"""Values of options: what is taken, and what is said of anything else."""

from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal

import pytest
import typer

from console.cli.values import read_plainly


class Word(Enum):
    FIRST = "first"
    SECOND = "second"


@pytest.fixture
def show() -> Callable[..., str]:
    app = typer.Typer()

    @app.command()
    def show(
        word: Word = Word.FIRST,
        literal: Literal["one", "two"] = "one",
        number: Annotated[int, typer.Option(min=1, max=9)] = 1,
        path: Path = Path("here"),
    ) -> None:
        shown.append(f"{word} {literal} {number} {path}")

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
        ([], "Word.FIRST one 1 here"),
        (["--word", "second"], "Word.SECOND one 1 here"),
        (["--literal", "two", "--number", "9", "--path", "a/b"], "Word.FIRST two 9 a/b"),
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
    ],
)
def test_anything_else_is_refused(show: Callable[..., str], words: list[str], expected: str) -> None:
    with pytest.raises(typer.BadParameter, match=expected):
        show(*words)
