"""A module of the tests as a program in a process of its own, to be stopped, frozen and killed."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE, Popen
from typing import Final

_ROOT: Final = Path(__file__).parents[2]


@contextmanager
def module_program(module: str, *arguments: str, says: str) -> Iterator[Popen[str]]:
    """Has said that it is ready when the block begins; killed when it ends.

    Args:
        module: what it runs.
        arguments: of its command line.
        says: its first line.
    """
    with Popen([sys.executable, "-m", module, *arguments], cwd=_ROOT, stdout=PIPE, text=True) as process:
        try:
            assert process.stdout
            assert process.stdout.readline() == f"{says}\n"
            yield process
        finally:
            process.kill()
