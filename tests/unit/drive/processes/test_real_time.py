"""What the kernel says of a process that is silent."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from drive.processes.real_time import delayed_by
from tests.support.waiting import wait_until


@contextmanager
def child(program: str) -> Iterator[int]:
    process = subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE)
    try:
        yield process.pid
    finally:
        process.kill()
        process.wait()
        assert process.stdin
        process.stdin.close()


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("while True: pass", "it waits for a processor, without real-time priority"),
        ("input()", "it waits in the kernel"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSTOP)", "it is stopped"),
        ("pass", "it has ended"),
    ],
)
def test_it_says_what_a_process_waits_for(program: str, words: str) -> None:
    with child(program) as pid:
        wait_until(lambda: delayed_by(pid).startswith(words), words)


def test_a_process_that_is_gone_is_not_an_error() -> None:
    with child("pass") as pid:
        os.kill(pid, signal.SIGKILL)
    assert delayed_by(pid).startswith("what it does is not known")
