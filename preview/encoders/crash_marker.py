"""Crash marker: which encoder was in use when the previous process crashed or hung.

A driver can end this process, by a crash or by a hang that only the end of the process resolves. The encoder
would prove itself in the next process's trial, be used and end that process, too; the marker makes the next
process pass it over for a while. A process that was killed from outside (SIGKILL, SIGTERM) blames no encoder.
The marker also names the encoders that have been proven, so that viewers need not wait for another trial.

In the runtime directory are the marker, written when an encoder starts and removed when it has stopped
properly, and the report that Python's fault handler writes on SIGSEGV, SIGABRT, SIGBUS, SIGFPE and SIGILL.
The next process moves a report aside, where it stays for people until the next crash.
"""

import faulthandler
import fcntl
import json
import logging
import os
import weakref
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Final

from common.private_files import make_own_directory
from preview.encoders.selection import Selection

_log = logging.getLogger(__name__)

_MARKER: Final = "encoder-in-use.json"
_REPORT: Final = "crash.txt"
LAST_REPORT: Final = "last-crash.txt"
_IN_USE_BY_ANOTHER: Final = "another preview service uses it; give each a runtime_dir of its own"
_IN_USE: Final = ""
"""Reason of a marker that blames the encoder only together with a crash report."""


class CrashMarkerFile:
    """The marker of this process, and what the previous one left.

    Args:
        directory: runtime directory, created when missing. Where it is not writable, not this user's own or
            in use by another service, a warning is logged, nothing in it is read or written, and the next
            process must find out by itself.
    """

    def __init__(self, directory: Path) -> None:
        self._claimed = False
        self._directory = directory
        self._marker = directory / _MARKER
        self._report = directory / _REPORT
        self._report_file: IO[bytes] | None = None

    def blame_previous(self, selection: Selection) -> None:
        """Passes over the encoder that ended the previous process; starts this process's crash report."""
        crash = self.begin_report()
        try:
            self._claim()
            marker = json.loads(self._marker.read_text(encoding="utf-8"))
            name, reason = str(marker["encoder"]), str(marker["why"])
            proven = {str(each) for each in marker.get("proven", ())}
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError) as error:
            _log.warning("the crash marker %s can't be read: %s", self._marker, error)
            return
        self.clear()
        if reason == _IN_USE and not crash:
            _log.info("the previous process was ended from outside while encoder %s was in use", name)
            selection.trust(proven)
            return
        reason = reason or f"the process crashed while it was in use ({crash})"
        text = f"encoder {name} is passed over: {reason}"
        _log.warning("%s", text)
        selection.pass_over(name, text)
        selection.trust(proven - {name})

    def begin_report(self) -> str:
        """Enables the crash report of this process.

        Returns:
            The cause of the previous process's crash, for example "Segmentation fault"; empty for none.
        """
        previous = ""
        try:
            self._claim()
            if self._report.exists():
                previous = _cause(self._report.read_text(encoding="utf-8", errors="replace"))
            if previous:
                self._report.replace(self._directory / LAST_REPORT)
            # Kept open: on a signal the handler can only write to an open file.
            self._report_file = self._report.open("wb")
        except OSError as error:
            _log.warning("no crash report in %s: %s", self._report, error)
        else:
            faulthandler.enable(self._report_file, all_threads=False)
        return previous

    def set(self, encoder: str, reason: str = _IN_USE, proven: Iterable[str] = ()) -> None:
        """Writes the marker.

        Args:
            encoder: name of the encoder that is about to be used, or that hangs.
            reason: what it did, for people. Empty: nothing yet; counts only if this process crashes.
            proven: names of the encoders that have been proven.
        """
        try:
            self._claim()
            marker = {"encoder": encoder, "why": reason, "proven": sorted(proven)}
            self._marker.write_text(json.dumps(marker), encoding="utf-8")
        except OSError as error:
            _log.warning("no crash marker for encoder %s in %s: %s", encoder, self._marker, error)

    def clear(self) -> None:
        """Removes the marker: no encoder is in use."""
        try:
            self._claim()
            self._marker.unlink(missing_ok=True)
        except OSError as error:
            _log.warning("the crash marker %s can't be removed: %s", self._marker, error)

    def _claim(self) -> None:
        """Makes the directory and locks it for the life of this object (flock(2)).

        Raises:
            OSError: it can't be made or is not this user's own; `BlockingIOError` if another process has it.
        """
        make_own_directory(self._directory)
        if self._claimed:
            return
        handle = os.open(self._directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(handle)
            if isinstance(error, BlockingIOError):
                raise BlockingIOError(error.errno, _IN_USE_BY_ANOTHER, str(self._directory)) from error
            raise
        self._claimed = True
        weakref.finalize(self, os.close, handle)


def _cause(report: str) -> str:
    """Returns CAUSE of the first line "Fatal Python error: CAUSE"."""
    first = report.partition("\n")[0]
    return first.partition(": ")[2] or first
