"""Runs a program and ends it when its heartbeats stop, so that it is restarted: for containers.

`python -m common.guard PROGRAM [ARGUMENT...]`. A container engine restarts a container whose program has
ended, but not one whose health check fails. The guard turns a program that is frozen, or hangs in native
code, into one that has ended. Signals reach the program; its exit code becomes the guard's, 128 + N for
signal N (as in a shell), EXIT_SILENT after silence.
"""

import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from typing import Final

from common.child import adopt_orphans, end_with_parent

EXIT_SILENT: Final = 70
"""EX_SOFTWARE of sysexits.h: the program sent no heartbeat and was killed."""
SILENCE_S: Final = 10
"""Between two heartbeats: long enough for a loop that competes for the CPU with everything else."""
_START_S: Final = 60
"""Until the first heartbeat; GStreamer's first scan of its plugins takes many seconds on a robot."""
_TICK_S: Final = 1.0
_ABORT_S: Final = 0.5
_ORPHANS_S: Final = 1.0
"""For what an ended program has left running; longer than its last words take."""
_POLL_S: Final = 0.02
_KILL_S: Final = 5.0
"""For the end of a killed program; past it, the end of the container must do."""


def guard(command: Sequence[str], start_s: int = _START_S, silence_s: int = SILENCE_S) -> int:
    """Runs a program to its end and returns the exit code of the guard.

    Args:
        command: the program and its arguments.
        start_s: longest time in seconds until the first heartbeat.
        silence_s: longest time in seconds between two heartbeats; one more second may pass until the kill.

    Raises:
        OSError: the program can't be started.
    """
    adopt_orphans()
    with (
        tempfile.TemporaryDirectory(prefix="guard-") as directory,
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heartbeats,
    ):
        address = f"{directory}/notify"
        heartbeats.bind(address)
        guarded = subprocess.Popen(  # noqa: S603  # the command that this program was called with
            command,
            env=os.environ | {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": str(silence_s * 1_000_000)},
            # Safe because this process has a single thread.
            preexec_fn=partial(end_with_parent, os.getpid()),  # noqa: PLW1509
        )
        signal.signal(signal.SIGTERM, lambda number, _: guarded.send_signal(number))
        # A terminal sends it to the program, too.
        signal.signal(signal.SIGINT, lambda *_: None)
        spoke = _ends(guarded, heartbeats, start_s, silence_s)
    if not spoke:
        _await_orphans()
        return EXIT_SILENT
    code = guarded.wait()
    _await_orphans()
    return code if code >= 0 else 128 - code


def _ends(
    guarded: "subprocess.Popen[bytes]", heartbeats: socket.socket, start_s: int, silence_s: int
) -> bool:
    """Waits until the program has ended by itself; False when it was killed because of its silence.

    Counts the guard's own ticks instead of reading a clock: if the whole container is frozen for an hour and
    goes on, or the machine sleeps, that is one tick.
    """
    ended = os.pidfd_open(guarded.pid)
    try:
        ticks, most = 0, start_s
        while ticks < most:
            ready, _, _ = select.select([ended, heartbeats.fileno()], [], [], _TICK_S)
            if ended in ready:
                return True
            if ready:
                heartbeats.recv(64)
                ticks, most = 0, silence_s
            else:
                ticks += 1
    finally:
        os.close(ended)
    print(f"error: no heartbeat for {most} s, killed", file=sys.stderr, flush=True)
    # Aborted, as systemd does, it can still write where it hangs (faulthandler), and so name a driver.
    for number, wait_s in ((signal.SIGABRT, _ABORT_S), (signal.SIGKILL, _KILL_S)):
        guarded.send_signal(number)
        try:
            guarded.wait(wait_s)
        except subprocess.TimeoutExpired:
            continue
        return False
    print("error: it does not end, not even when killed", file=sys.stderr, flush=True)
    return False


def _await_orphans() -> None:
    """Waits for processes that the program has left behind: with this one, a container ends them at once.

    The drive program's worker, for one, still has to send zeros to the robot.
    """
    end_s = time.monotonic() + _ORPHANS_S
    while time.monotonic() < end_s:
        try:
            pid, _ = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return
        if not pid:
            # Polled: only SIGCHLD announces the end of a process that another one started.
            time.sleep(_POLL_S)


def main() -> None:
    """Entry point."""
    if not sys.argv[1:]:
        raise SystemExit("usage: python -m common.guard PROGRAM [ARGUMENT...]")
    try:
        code = guard(sys.argv[1:])
    except OSError as error:
        raise SystemExit(f"error: {sys.argv[1]} can't be started: {error.strerror}") from error
    raise SystemExit(code)


if __name__ == "__main__":
    main()
