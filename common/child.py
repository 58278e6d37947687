"""A helper process that never outlives its use, however its code, or a driver it calls, hangs."""

import ctypes
import os
import signal
from typing import Final

_PR_SET_PDEATHSIG: Final = 1


def end_with_parent(at_most_s: int) -> None:
    """Has the kernel end this process when the thread that started it ends, and after `at_most_s` seconds.

    Both work while Python itself is stuck in a driver: prctl(2) PR_SET_PDEATHSIG sends SIGKILL, alarm(2) the
    default SIGALRM. To be called first.
    """
    parent = os.getppid()
    signal.alarm(at_most_s)
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL):
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG)")
    if os.getppid() != parent:
        # It ended before the kernel knew.
        os._exit(os.EX_UNAVAILABLE)
