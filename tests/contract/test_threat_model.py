"""Every promise of the threat model and of the safety case of driving names tests that exist."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODELS = [
    (ROOT / page).read_text(encoding="utf-8").partition(heading)[2]
    for page, heading in (("docs/security.md", "## Threat model"), ("docs/driving.md", "## Safety case"))
]
PROMISES = [
    promise
    for model in MODELS
    for promise in re.findall(r"^\| ([^|]+) \| (`tests/[^|]+`) \|$", model, re.MULTILINE)
]


def exists(test: str) -> bool:
    """Whether `file::test` names a test function, or a state machine of Hypothesis."""
    file, _, name = test.partition("::")
    path = ROOT / file
    if not path.is_file() or not name.startswith(("test_", "Test")):
        return False
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return any(name in (*_function(each), *_state_machine(each)) for each in tree.body)


def _function(statement: ast.stmt) -> tuple[str, ...]:
    return (statement.name,) if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef) else ()


def _state_machine(statement: ast.stmt) -> tuple[str, ...]:
    match statement:
        case ast.Assign(targets=[ast.Name(id=name)], value=ast.Attribute(attr="TestCase")):
            return (name,)
        case _:
            return ()


def test_every_row_of_the_table_is_read() -> None:
    tables = [model.split("| promise | test |\n|---|---|\n")[1].split("\n\n")[0] for model in MODELS]
    assert len(PROMISES) == sum(len(table.splitlines()) for table in tables)


@pytest.mark.parametrize(("promise", "tests"), PROMISES, ids=[promise for promise, _ in PROMISES])
def test_a_promise_names_tests_that_exist(promise: str, tests: str) -> None:
    missing = [test for test in re.findall(r"`([^`]+)`", tests) if not exists(test)]
    assert missing == [], promise


def test_one_that_is_gone_would_be_noticed() -> None:
    assert exists("tests/contract/test_threat_model.py::test_one_that_is_gone_would_be_noticed")
    assert not exists("tests/contract/test_threat_model.py::test_gone")
    assert not exists("tests/contract/test_gone.py::test_one_that_is_gone_would_be_noticed")
