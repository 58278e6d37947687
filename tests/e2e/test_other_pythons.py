"""`scripts/test --python`: what it refuses, without a network; and what becomes of that in `.ci/run`."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        pytest.param([], "usage: scripts/test --python 3.12 [arguments of pytest]", id="no version"),
        pytest.param(
            ["tests/unit"], "usage: scripts/test --python 3.12 [arguments of pytest]", id="no number"
        ),
        pytest.param(["3.10"], "Python 3.10 is older than 3.11, which pyproject.toml requires", id="too old"),
    ],
)
def test_a_version_it_can_not_test_is_refused(arguments: list[str], sentence: str) -> None:
    ended = subprocess.run(
        [ROOT / "scripts/test", "--python", *arguments],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    assert ended.returncode == 2
    assert ended.stderr == f"test-python: {sentence}\n"


def integration(tree: Path, status: int) -> "subprocess.CompletedProcess[str]":
    """`.ci/run` in a tree of its own, whose programs do nothing, where `scripts/test --python` ends so."""
    programs = {
        "docker/engine": "exit 0",
        "docker/base-image.sh": "exit 0",
        "scripts/setup": "exit 0",
        "scripts/test": f'[ "$1" != --python ] || exit {status}',
    }
    for name, line in programs.items():
        program = tree / name
        program.parent.mkdir(exist_ok=True)
        program.write_text(f"#!/bin/sh\n{line}\n", encoding="utf-8")
        program.chmod(0o755)
    (tree / ".ci").mkdir()
    shutil.copy(ROOT / ".ci/run", tree / ".ci/run")
    return subprocess.run([tree / ".ci/run"], capture_output=True, text=True, timeout=30, check=False)


@pytest.mark.parametrize(
    ("status", "ended", "says_so"),
    [
        pytest.param(0, 0, False, id="tested"),
        pytest.param(1, 1, False, id="failed"),
        pytest.param(77, 0, True, id="no interpreter"),
    ],
)
def test_integration_says_last_that_a_python_was_not_tested(
    tmp_path: Path, status: int, ended: int, says_so: bool
) -> None:
    ran = integration(tmp_path, status)
    assert ran.returncode == ended, ran.stderr
    assert ("NOT TESTED: Python 3.12" in ran.stderr) == says_so
