"""Every promise of the threat model in docs/security.md names tests that exist."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODEL = (ROOT / "docs/security.md").read_text(encoding="utf-8").partition("## Threat model")[2]
PROMISES = re.findall(r"^\| ([^|]+) \| (`tests/[^|]+`) \|$", MODEL, re.MULTILINE)


def exists(test: str) -> bool:
    """Whether `file::test` names a test function."""
    file, _, name = test.partition("::")
    path = ROOT / file
    if not path.is_file() or not name.startswith("test_"):
        return False
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return any(isinstance(each, functions) and each.name == name for each in tree.body)


def test_every_row_of_the_table_is_read() -> None:
    table = MODEL.split("| promise | test |\n|---|---|\n")[1].split("\n\n")[0]
    assert len(PROMISES) == len(table.splitlines())


@pytest.mark.parametrize(("promise", "tests"), PROMISES, ids=[promise for promise, _ in PROMISES])
def test_a_promise_names_tests_that_exist(promise: str, tests: str) -> None:
    missing = [test for test in re.findall(r"`([^`]+)`", tests) if not exists(test)]
    assert missing == [], promise


def test_one_that_is_gone_would_be_noticed() -> None:
    assert exists("tests/contract/test_threat_model.py::test_one_that_is_gone_would_be_noticed")
    assert not exists("tests/contract/test_threat_model.py::test_gone")
    assert not exists("tests/contract/test_gone.py::test_one_that_is_gone_would_be_noticed")
