"""Runs the whole gateway without ROS in a process of its own (bench.status_server)."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from bench.processes import first_line, piped_program


@dataclass(frozen=True, slots=True)
class Stack:
    """A running server: its process ID and TCP port."""

    pid: int
    port: int


@contextmanager
def running_stack(*words: str) -> Iterator[Stack]:
    """Serves until the block ends.

    Args:
        words: "limited" for the default rate limits; "guarded" and a directory of credentials for TLS and
            authentication.
    """
    with piped_program("bench.status_server", *words) as process:
        yield Stack(process.pid, int(first_line(process)))
