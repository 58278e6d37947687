"""A short run over every parser, and the proof that a defect would be found."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import fuzz.__main__ as program
from fuzz import OUTPUT, fleet
from fuzz.worker import OURS

ROOT = Path(__file__).parents[3]
LONG_S = 300


def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=LONG_S,
        check=False,
    )


@pytest.mark.timeout(LONG_S)
def test_nothing_is_found_in_a_short_run() -> None:
    # A run of the tests tries what the last one tried; others are for scripts/fuzz.
    ended = run("fuzz", "--runs", "2000", "--seed", "1")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    tried = [line for line in ended.stdout.splitlines() if "2,000" in line]
    assert len(tried) == len(program.NAMES)
    assert all("nothing" in line for line in tried)


def test_every_target_is_tried() -> None:
    said = run("fuzz.worker", "--list")
    assert said.stdout.split() == list(program.NAMES)


def test_the_lines_of_every_package_that_a_target_imports_guide_the_fuzzer() -> None:
    ours = {each.parent.name for each in ROOT.glob("*/__init__.py")} - {"bench", "fuzz", "tests"}
    imported = {
        node.module.partition(".")[0]
        for file in (ROOT / "fuzz").glob("*.py")
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module
    }
    assert imported & ours <= set(OURS)


def test_the_receivers_store_in_memory_has_all_that_the_receiver_calls() -> None:
    source = "".join((ROOT / f"hub/receiver/{name}.py").read_text() for name in ("service", "verified"))
    called = set(re.findall(r"self\._store\.(\w+)", source))
    assert "create" in called
    assert called <= set(vars(vars(fleet)["_Store"]))


def test_a_defect_is_found_and_can_be_tried_again(tmp_path: Path) -> None:
    # Requests as they would be checked by code that knows four profiles and expects no other.
    careless = (
        "import sys, gateway.rpc.interceptors.validation as validation\n"
        "validation.validate = lambda request: {0: 0, 1: 1, 2: 2, 3: 3}[getattr(request, 'profile', 0)]\n"
        "from fuzz.worker import main\n"
        "main(sys.argv[1:])\n"
    )
    found = subprocess.run(
        [sys.executable, "-c", careless, str(tmp_path), "50000", "1", "operators_request"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=LONG_S,
        check=True,
    )
    name, code, _ = found.stdout.split()
    assert name == "operators_request"
    assert code != "0"
    directory = tmp_path / name
    assert program.last_words((directory / OUTPUT).read_text(errors="replace")).startswith("KeyError: ")
    (kept,) = directory.glob("crash-*")
    assert run("fuzz", "--target", "operators_request", "--input", str(kept)).returncode == 0, "ours takes it"
