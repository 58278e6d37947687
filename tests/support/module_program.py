"""A module of the tests as a program in a process of its own, to be stopped, frozen and killed."""

from collections.abc import Iterator
from contextlib import contextmanager
from subprocess import Popen

from tests.support.helper import first_line, helper


@contextmanager
def module_program(module: str, *arguments: str, says: str) -> Iterator[Popen[str]]:
    """Has said that it is ready when the block begins; killed when it ends.

    Args:
        module: what it runs.
        arguments: of its command line.
        says: its first line.
    """
    with helper(module, *arguments) as process:
        assert first_line(process) == f"{says}\n"
        yield process
