"""The Docker engine for tests: found, or the tests skipped with one line; images built once per run."""

import os
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TAG = "e2e"
_BUILD_WITHIN_S = 1500


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--require-docker`: where continuous integration runs, a missing engine is a failure."""
    parser.addoption(
        "--require-docker", action="store_true", help="fail, rather than skip, where no Docker engine answers"
    )


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skips what needs Docker where there is none: here, so that all of it makes one line of the summary."""
    if item.get_closest_marker("docker") is None or not (problem := _problem()):
        return
    if item.config.getoption("--require-docker"):
        pytest.fail(f"--require-docker: {problem}", pytrace=False)
    pytest.skip(f"{problem}. Type: docker/engine start")


@pytest.fixture(scope="session")
def images() -> str:
    """Both images, built from this tree; their tag."""
    # Its reaper is one more image, which can't be had everywhere; every test removes what is its own.
    os.environ["TESTCONTAINERS_RYUK_DISABLED"] = "true"
    built = subprocess.run(
        [ROOT / "docker/test-images"], capture_output=True, text=True, timeout=_BUILD_WITHIN_S, check=False
    )
    assert built.returncode == 0, f"docker/test-images: {built.stderr[-3000:]}"
    return TAG


@cache
def _problem() -> str:
    """Why tests can't use Docker; empty when they can."""
    for command in (["docker", "info"], ["docker", "compose", "version"]):
        try:
            asked = subprocess.run(command, capture_output=True, timeout=30, check=False)
        except FileNotFoundError:
            return "Docker is not installed"
        except subprocess.TimeoutExpired:
            return f"'{' '.join(command)}' does not answer"
        if asked.returncode:
            return f"'{' '.join(command)}' fails: no engine runs, or compose is missing"
    return ""
