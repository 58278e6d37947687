"""Whether the last process crashed: what Python's fault handler wrote when a fatal signal came.

A driver that crashes takes the process with it by SIGSEGV, SIGABRT, SIGBUS, SIGFPE or SIGILL, and the handler
leaves a report before the process dies. A process that was killed (SIGKILL: a person, the kernel short of
memory, a container that is restarted) leaves none.
"""

import faulthandler
import logging
from pathlib import Path
from typing import IO, Final

_log = logging.getLogger(__name__)

NAME: Final = "crash.txt"


class CrashReport:
    """The report of the last process, read once, and the place for one of this process.

    Args:
        runtime_dir: where it is; made when it doesn't exist.
    """

    def __init__(self, runtime_dir: Path) -> None:
        self._path = runtime_dir / NAME
        self._file: IO[bytes] | None = None

    def begin(self) -> str:
        """Has a crash of this process reported from now on.

        Returns:
            What ended the last process, "Segmentation fault" for example; empty when it did not crash.
        """
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            last = _cause(self._path.read_text(encoding="utf-8", errors="replace"))
        except FileNotFoundError:
            last = ""
        except OSError as error:
            _log.warning("no crash report in %s: %s", self._path, error)
            return ""
        try:
            # Kept open: the handler can only write to what is open when the signal comes.
            self._file = self._path.open("wb")
        except OSError as error:
            _log.warning("no crash report in %s: %s", self._path, error)
        else:
            faulthandler.enable(self._file, all_threads=False)
        return last


def _cause(report: str) -> str:
    """The first line says "Fatal Python error: CAUSE"."""
    first = report.partition("\n")[0]
    return first.partition(": ")[2] or first
