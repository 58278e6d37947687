"""Ends what a test process has started, when that process has ended without doing so itself.

No fixture ends what it has started in a process that is killed, or ended amid a test that hangs (bounds.py).
The reaper is a process of its own, which waits for the end of the other one: it is no child of it that a test
could find among its own, and has none of its standard streams, whose end another program may wait for.

    reaper.py PID NAME=VALUE

ends all processes with this variable in their environment once the process PID has ended.
"""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

_ROUNDS: Final = 50
_EVERY_S: Final = 0.1
"""What is killed may have started something meanwhile: so it looks again, for 5 s at most."""


def start_reaper(name: str, value: str) -> None:
    """Has what bears this variable ended after this process.

    Raises:
        RuntimeError: the reaper could not start, with what it said.
    """
    others = {each: text for each, text in os.environ.items() if each != name}
    # Its first process returns at once, and leaves the second one to the system.
    started = subprocess.run(
        [sys.executable, "-I", "-S", __file__, str(os.getpid()), f"{name}={value}"],
        env=others,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        check=False,
    )
    if started.returncode:
        raise RuntimeError(f"nothing would end what the tests leave behind: {started.stderr.strip()}")


def _reap(pid: int, variable: bytes) -> None:
    try:
        process = os.pidfd_open(pid)
    except OSError as error:
        sys.exit(f"pidfd_open({pid}) is refused: {error.strerror}")
    if os.fork():
        return
    os.dup2(sys.stdout.fileno(), sys.stderr.fileno())  # The pipe that the first process reports to ends.
    os.chdir("/")
    ended = select.poll()
    ended.register(process, select.POLLIN)
    ended.poll()
    for _ in range(_ROUNDS):
        if not list(_killed(variable)):
            return
        time.sleep(_EVERY_S)


def _killed(variable: bytes) -> Iterator[int]:
    """Kills what bears the variable, and yields each."""
    for directory in Path("/proc").glob("[0-9]*"):
        try:
            # First: whatever gets the number later is another process.
            process = os.pidfd_open(int(directory.name))
        except OSError:
            continue  # It has ended, or is a thread.
        try:
            if variable in (directory / "environ").read_bytes().split(b"\0"):
                signal.pidfd_send_signal(process, signal.SIGKILL)
                yield int(directory.name)
        except OSError:
            continue  # It has ended, or is another user's.
        finally:
            os.close(process)


if __name__ == "__main__":
    _reap(int(sys.argv[1]), os.fsencode(sys.argv[2]))
