"""Errors of the client library are for programs of all kinds: they name no option of robotctl."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from release_program.distributions import CLIENT
from release_program.modules import closure

ROOT = Path(__file__).parents[2]
# The receiver is for programs of others as well (docs/client.md), though in another distribution.
ENTRIES = (*CLIENT.entries, "console.receiver")
FILES = sorted(each.source for each in closure(ROOT, ENTRIES) if each.source.suffix == ".py")
OPTION = re.compile(r"(?<![\w-])--[a-z]")
COMMAND = re.compile(r"\b(robotctl|robot-[a-z]+) [a-z]")
"""An option of a command that is there whole is right in any program."""


def texts(source: str) -> Iterator[ast.Constant]:
    """The texts of a file, without docstrings, which are for those who read it."""
    tree = ast.parse(source)
    docstrings = {id(each.value) for each in ast.walk(tree) if isinstance(each, ast.Expr)}
    for each in ast.walk(tree):
        if isinstance(each, ast.Constant) and isinstance(each.value, str) and id(each) not in docstrings:
            yield each


def options(source: str) -> list[int]:
    """The lines of a file whose texts name an option."""
    found = [(each.lineno, OPTION.search(str(each.value)), str(each.value)) for each in texts(source)]
    return [line for line, option, text in found if option and not COMMAND.search(text[: option.start()])]


def test_the_library_is_what_is_examined() -> None:
    examined = {str(file) for file in FILES}
    assert {"console/client/aio.py", "console/receiver/errors.py", "console/robots/choice.py"} <= examined
    assert not any(file.startswith("console/cli/") for file in examined)


@pytest.mark.parametrize("file", FILES, ids=str)
def test_no_text_of_the_library_names_an_option(file: Path) -> None:
    """console/cli adds what its users can type."""
    assert options((ROOT / file).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("raise UserError('x', 'Use the address (--target HOST)')", [1]),
        ("raise UserError('x', f'Add --robot {name}')", [1]),
        ("raise UserError('x', 'Type: robotctl login NAME --replace')", []),
        ("raise UserError('x', 'Add --replace to robotctl login')", [1]),
        ("'''Value of --target.'''", []),
        ("x = '--:--:--'", []),
    ],
)
def test_it_finds_options_alone(line: str, found: list[int]) -> None:
    assert options(line) == found
