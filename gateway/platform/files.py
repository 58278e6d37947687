"""Reads the small files in /proc and /sys by which Linux describes the machine."""

from pathlib import Path


def text(path: Path) -> str | None:
    """Returns the file's content without surrounding white space; None if it can't be read now."""
    try:
        return path.read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        return None


def number(path: Path) -> int | None:
    """Returns the file's content as an integer; None if it holds none."""
    try:
        return int(text(path) or "")
    except ValueError:
        return None
