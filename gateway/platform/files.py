"""Reading the small files by which Linux tells about the machine."""

from pathlib import Path


def text(path: Path) -> str | None:
    """The file's only line; None when it does not exist or the driver has nothing to say now."""
    try:
        return path.read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        return None


def number(path: Path) -> int | None:
    """The file's whole number; None when there is none."""
    content = text(path)
    try:
        return int(content) if content else None
    except ValueError:
        return None
