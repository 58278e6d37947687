"""`scripts/test --python`: what it refuses, without a network."""

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
