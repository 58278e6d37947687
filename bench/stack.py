"""The gateway's own stack in a process of its own, for the benchmarks of the door (bench.status_server)."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Stack:
    """A server that runs."""

    pid: int
    port: int


@contextmanager
def running_stack(*words: str) -> Iterator[Stack]:
    """Serves until the block ends.

    Args:
        words: "limited" for the bounds that a gateway has by default; "guarded" and a directory of
            credentials for one that asks who calls, over TLS.
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
