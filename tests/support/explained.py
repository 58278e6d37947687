"""The log of a program under test, in the report of a test that fails."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

_LINES: Final = 20


@contextmanager
def explained_by(log: Path) -> Iterator[None]:
    """Adds the last lines of a log to an error that leaves the block."""
    try:
        yield
    except BaseException as error:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
        error.add_note("\n".join([f"{log.name}:", *lines[-_LINES:]]))
        raise
