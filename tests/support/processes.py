"""Processes that a test does not own."""

import psutil


def has_ended(pid: int) -> bool:
    """Returns whether a process has ended, also before its parent or init has asked how (a zombie)."""
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True
