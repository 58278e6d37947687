"""Programs of tests.support that run beside a test, in a process of their own."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_ROOT = Path(__file__).parents[2]


@contextmanager
def helper(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Runs `python -m ARGUMENTS` until the block ends."""
    process = subprocess.Popen(
        [sys.executable, "-m", *arguments],
        cwd=_ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def first_line(process: subprocess.Popen[str]) -> str:
    """Returns the first line that the helper prints."""
    assert process.stdout
    return process.stdout.readline()


def last_words(process: subprocess.Popen[str]) -> str:
    """Closes the helper's standard input, and returns what it prints until it ends."""
    return process.communicate("", timeout=20)[0]
