"""Limits the lifetime of a helper process, even while it hangs in native code such as a driver."""

import ctypes
import os
import signal
from typing import Final

_PR_SET_PDEATHSIG: Final = 1
_PR_SET_CHILD_SUBREAPER: Final = 36


def adopt_orphans() -> None:
    """Makes this process the parent of those that its children leave behind (prctl(2), a "subreaper").

    Raises:
        OSError: the kernel refuses.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_CHILD_SUBREAPER, 1):
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_CHILD_SUBREAPER)")


def end_with_parent(parent: int, at_most_s: int = 0) -> None:
    """Makes the kernel kill this process when the thread that started it ends, or after `at_most_s` seconds.

    Must be called first. Both limits work while the interpreter is stuck in native code: prctl(2)
    PR_SET_PDEATHSIG sends SIGKILL, and alarm(2) SIGALRM, whose default action ends the process. A parent that
    has already ended ends this process at once.

    Args:
        parent: process ID of the parent, from the parent itself: getppid(2) here may already name another.
        at_most_s: 0 for no limit.

    Raises:
        OSError: the kernel refuses the parent-death signal.
    """
    signal.alarm(at_most_s)
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL):
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG)")
    if os.getppid() != parent:
        os._exit(os.EX_UNAVAILABLE)
