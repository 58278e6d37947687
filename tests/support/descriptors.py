"""Descriptors of this process."""

from contextlib import suppress
from pathlib import Path


def descriptors_of(path: Path) -> list[int]:
    """This process's descriptors of a file, also of a deleted one."""
    found = []
    for each in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # Another thread may close one meanwhile.
            if str(path) in str(each.readlink()):
                found.append(int(each.name))
    return found
