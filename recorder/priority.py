"""The recorder's place behind everything else on the robot: the mission never waits for a disk."""

import ctypes
import logging
import os
from typing import Final

_log = logging.getLogger(__name__)

_NICE: Final = 10
_SYS_IOPRIO_SET: Final = {"x86_64": 251, "aarch64": 30}
"""By machine: linux/arch/x86/entry/syscalls/syscall_64.tbl, include/uapi/asm-generic/unistd.h."""
_IOPRIO_WHO_PROCESS: Final = 1
_BEST_EFFORT_LOWEST: Final = 2 << 13 | 7
"""IOPRIO_CLASS_BE, level 7 (ioprio_set(2)). Never idle, also where it was started so: a disk that others keep
busy must still take what is recorded."""


def step_back() -> None:
    """Lowers the priority of this thread, and of those that it starts, for the CPU and for the disk."""
    try:
        # Root could also raise it: a supervisor may have started this program with a lower one.
        os.setpriority(os.PRIO_PROCESS, 0, max(_NICE, os.getpriority(os.PRIO_PROCESS, 0)))
    except OSError as error:
        _log.info("without a lower priority for the CPU: %s", error.strerror)
    number = _SYS_IOPRIO_SET.get(os.uname().machine)
    libc = ctypes.CDLL(None, use_errno=True)
    if number and libc.syscall(number, _IOPRIO_WHO_PROCESS, 0, _BEST_EFFORT_LOWEST):
        _log.info("without a lower priority for the disk: %s", os.strerror(ctypes.get_errno()))
