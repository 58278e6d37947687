"""The audit log: every control action and every change of access, a JSON object each, bounded on the disk.

The event loop never waits for a disk: lines go through a bounded queue to one thread. A line that finds
the queue full, or the disk, is counted and lost, and the operators see a fault; it is in the log anyway.
"""

import errno
import json
import logging
import os
import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Final

_log = logging.getLogger(__name__)

_QUEUE: Final = 256
_STOP_WITHIN_S: Final = 2.0
_FILE_MODE: Final = 0o600
_COMPLAIN_EVERY: Final = 100
"""Lost lines between two complaints in the log."""


@dataclass(frozen=True, slots=True)
class AuditRecord:
    """What somebody did, or tried to.

    Attributes:
        who: the caller's name; empty when nobody knows.
        role: what they may do; empty as well.
        credential: by which credential they were known.
        address: where the call came from.
        action: the method.
        request: what was asked for, for a person.
        result: "accepted", "refused" or "failed".
        answer: what was answered, for a person.
        request_id: as in the logs.
    """

    who: str
    role: str
    credential: str
    address: str
    action: str
    request: str
    result: str
    answer: str
    request_id: str

    def line(self, at: datetime) -> str:
        """As it is written."""
        time = at.astimezone(UTC).isoformat(timespec="milliseconds")
        return json.dumps({"time": time, **asdict(self)}, ensure_ascii=True) + "\n"


class AuditLog:
    """Takes records on the event loop; a thread of its own writes them while `writing` lasts.

    Args:
        path: the file; its older generations are `path`.1, `path`.2 and so on. None: the log alone.
        most_bytes: of one generation.
        generations: how many there are, the newest included.
    """

    def __init__(self, path: Path | None, most_bytes: int, generations: int) -> None:
        self._path = path
        self._most_bytes = most_bytes
        self._generations = generations
        self._queue: queue.Queue[str | None] = queue.Queue(_QUEUE)
        self.lost = 0
        """Lines that did not reach the file since the start."""
        self.trouble = ""
        """Why the newest line could not be written; empty when it was."""

    def note(self, record: AuditRecord) -> None:
        """Takes one record. Never waits."""
        _log.info(
            "audit: %s (%s) from %s: %s (%s): %s, %s",
            record.who or "nobody known",
            record.role or "no role",
            record.address,
            record.action,
            record.request or "nothing more",
            record.result,
            record.answer,
        )
        if self._path is None:
            return
        try:
            self._queue.put_nowait(record.line(datetime.now(UTC)))
        except queue.Full:
            self._lose("the disk is too slow")

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Lines are written while the block lasts; those that wait at its end, too, for 2 s at most."""
        if self._path is None:
            yield
            return
        # A disk that hangs must not hold up the end of the program.
        thread = threading.Thread(target=self._write_all, args=(self._path,), name="audit", daemon=True)
        thread.start()
        try:
            yield
        finally:
            try:
                self._queue.put(None, timeout=_STOP_WITHIN_S)
            except queue.Full:
                self._lose("the disk hangs")
            thread.join(_STOP_WITHIN_S)

    def _write_all(self, path: Path) -> None:
        while (line := self._queue.get()) is not None:
            try:
                self._make_room(path, len(line))
                _append(path, line.encode())
            except OSError as error:
                self._lose(f"{path} can't be written: {error.strerror}")
            else:
                self.trouble = ""

    def _make_room(self, path: Path, more_bytes: int) -> None:
        """The file as it is becomes an older generation where it would grow too large."""
        try:
            size = path.stat().st_size
        except FileNotFoundError:
            return
        if size + more_bytes <= self._most_bytes:
            return
        generations = [
            path,
            *(path.with_name(f"{path.name}.{number}") for number in range(1, self._generations)),
        ]
        if len(generations) == 1:
            path.unlink()
        for newer, older in reversed(list(pairwise(generations))):
            if newer.exists():
                newer.replace(older)

    def _lose(self, why: str) -> None:
        self.trouble = why
        self.lost += 1
        if self.lost % _COMPLAIN_EVERY == 1:
            _log.error("audit: %s; %d lines are lost so far", why, self.lost)


def _append(path: Path, line: bytes) -> None:
    """A whole line or none: of one that a full disk has cut, nothing stays."""
    handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, _FILE_MODE)
    try:
        before = os.fstat(handle).st_size
        written = os.write(handle, line)
        if written < len(line):
            os.ftruncate(handle, before)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    finally:
        os.close(handle)
