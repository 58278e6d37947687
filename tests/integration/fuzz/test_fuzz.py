"""A short run over every parser, and the proof that a defect would be found."""

import subprocess
import sys
from pathlib import Path

import pytest

import fuzz.__main__ as program

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
    ended = run("fuzz", "--runs", "2000")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    tried = [line for line in ended.stdout.splitlines() if "2,000" in line]
    assert len(tried) == len(program.NAMES)
    assert all("nothing" in line for line in tried)


def test_every_target_is_tried() -> None:
    said = run("fuzz.worker", "--list")
    assert said.stdout.split() == list(program.NAMES)


def test_a_defect_is_found_and_can_be_tried_again(tmp_path: Path) -> None:
    # Requests as they would be checked by somebody who knows four profiles and expects no other.
    careless = (
        "import sys, gateway.rpc.interceptors.validation as validation\n"
        "validation.validate = lambda request: {0: 0, 1: 1, 2: 2, 3: 3}[getattr(request, 'profile', 0)]\n"
        "from fuzz.worker import main\n"
        "main(sys.argv[1:])\n"
    )
    corpus = tmp_path / "corpus"
    corpus.mkdir()
    command = [sys.executable, "-c", careless, "operators_request"]
    found = subprocess.run(
        [*command, "50000", str(corpus)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=LONG_S,
        check=False,
    )
    assert found.returncode != 0
    assert program.last_words(found.stdout + found.stderr).startswith("KeyError: ")
    (kept,) = tmp_path.glob("crash-*")
    assert run("fuzz", "--target", "operators_request", "--input", str(kept)).returncode == 0, "ours takes it"
