"""Runs the whole gateway without ROS in a process of its own (bench.status_server)."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


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
    with subprocess.Popen(
        [sys.executable, "-m", "bench.status_server", *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdin
        assert process.stdout
        try:
            yield Stack(process.pid, int(process.stdout.readline()))
        finally:
            process.stdin.close()
