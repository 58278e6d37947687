"""Descriptors of this process."""

from pathlib import Path


def descriptors_of(path: Path) -> list[int]:
    """This process's descriptors of a file, also of a deleted one."""
    return [
        int(each.name)
        for each in Path("/proc/self/fd").iterdir()
        if each.is_symlink() and str(path) in str(each.readlink())
    ]
