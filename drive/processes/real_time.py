"""What keeps the system from delaying this process: real-time priority, and memory that stays in memory.

The system refuses either without the right to it; then the program runs without, and says so.
"""

import ctypes
import logging
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Final

_log = logging.getLogger(__name__)

_REAL_TIME: Final = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
"""Not for the children: a worker that starts has no deadline to keep."""
_LOCK_PRESENT: Final = 1 | 4
"""MCL_CURRENT | MCL_ONFAULT, mlockall(2): what has been touched. MCL_FUTURE would have allocations fail that
exceed RLIMIT_MEMLOCK."""

_RUNNABLE: Final = "R"
"""It runs, or would if a processor were free; a process that runs sends its heartbeats."""
_DOING: Final = {
    "S": "it waits in the kernel",
    "D": "it waits for a device",
    "T": "it is stopped",
    "t": "a debugger has stopped it",
    "Z": "it has ended",
    "X": "it has ended",
}
"""By the letter of proc_pid_stat(5)."""


def raise_priority(priority: int) -> None:
    """Asks for real-time priority, which RLIMIT_RTPRIO (`ulimit -r`) permits without privileges.

    For all threads: this one waits for locks of the middleware's, and for the interpreter's lock.
    """
    for task in Path("/proc/self/task").iterdir():
        try:
            os.sched_setscheduler(int(task.name), _REAL_TIME, os.sched_param(priority))
        except ProcessLookupError:
            continue  # It has ended meanwhile.
        except OSError as error:
            _log.info("without real-time priority: %s", error.strerror)
            return


def delayed_by(pid: int) -> str:
    """Returns what keeps a silent process from going on, as the kernel sees it at this moment, for people."""
    try:
        # The command's name, in parentheses, may contain anything: proc_pid_stat(5).
        state = Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()[0].decode()
        where = Path(f"/proc/{pid}/wchan").read_text(encoding="ascii", errors="replace")
        real_time = os.sched_getscheduler(pid) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
    except OSError as error:
        return f"what it does is not known ({error.strerror})"
    if state == _RUNNABLE:
        return "it waits for a processor" + ("" if real_time else ", without real-time priority")
    doing = _DOING.get(state, f"it is in state {state}")
    return f"{doing} ({where})" if where.strip("0") else doing


def lock_memory() -> None:
    """Asks for memory that is never paged out, which RLIMIT_MEMLOCK (`ulimit -l`) permits without privileges.

    Code is read from the disk now, all of it: where memory is short the system drops what has not run for a
    while, and reading it again takes as long as a busy disk does.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    locked = libc.mlockall(_LOCK_PRESENT) == 0 and all(
        libc.mlock(ctypes.c_void_p(start), ctypes.c_size_t(end - start)) == 0 for start, end in _code()
    )
    if not locked:
        _log.info("memory is not locked: %s", os.strerror(ctypes.get_errno()))


def _code() -> Iterator[tuple[int, int]]:
    """Yields the address ranges of code from files, proc_pid_maps(5)."""
    for line in Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace").splitlines():
        addresses, permissions, *rest = line.split(maxsplit=5)
        if "x" in permissions and len(rest) == 4 and rest[3].startswith("/"):
            start, end = addresses.split("-")
            yield int(start, 16), int(end, 16)
