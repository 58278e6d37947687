"""The audit log: every control action and change of access, one JSON object a line, bounded on the disk.

The event loop never waits for a disk: lines go through a bounded queue to one thread. A line that finds the
queue or the disk full is counted as lost and operators see a fault; the program's own log has it in any
case.

Not logging.handlers.RotatingFileHandler: it swallows a failed write (`Handler.handleError`), so that no
fault could be raised, and leaves half a line behind when the disk fills up.
"""

import errno
import json
import logging
import os
import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Final

from common.private_files import sync_directory
from gateway.status.event import ControlAction, Motion

_log = logging.getLogger(__name__)

_QUEUE: Final = 1024
"""Lines that wait for the disk: enough for a burst of each caller of `Repeats`."""
_STOP_WITHIN_S: Final = 2.0
_FILE_MODE: Final = 0o600
_COMPLAIN_EVERY: Final = 100
"""Lost lines between two complaints in the log."""


class AuditLog:
    """Takes actions on the event loop; a thread of its own writes them while `writing` lasts.

    Args:
        path: the file; its older generations are `path`.1, `path`.2 and so on. None writes to the log alone.
        most_bytes: maximum size of one generation.
        generations: how many are kept, the newest included.
    """

    def __init__(self, path: Path | None, most_bytes: int, generations: int) -> None:
        self._path = path
        self._most_bytes = most_bytes
        self._generations = generations
        self._queue: queue.Queue[str | None] = queue.Queue(_QUEUE)
        self.lost = 0
        """Lines that did not reach the file since the start."""
        self.error = ""
        """Why the newest line could not be written; empty when it was."""

    def record(self, action: ControlAction) -> None:
        """Takes one action. Never waits."""
        _log.info(
            "audit: %s (%s) from %s: %s (%s): %s, %s%s",
            action.who or "unauthenticated caller",
            action.role or "no role",
            action.address,
            action.method,
            action.request or "no parameters",
            action.result.value,
            action.answer,
            f" ({action.count} times)" if action.count > 1 else "",
        )
        if self._path is None:
            return
        try:
            self._queue.put_nowait(line_of(action))
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
                # Once for a burst of lines; what waits behind the last one may be the end.
                if self._queue.qsize() <= 1:
                    _sync(path)
            except OSError as error:
                self._lose(f"{path} can't be written: {error.strerror}")
            else:
                self.error = ""

    def _make_room(self, path: Path, more_bytes: int) -> None:
        """The file as it is becomes an older generation where it would grow too large."""
        try:
            size = path.stat().st_size
        except FileNotFoundError:
            return
        if size + more_bytes <= self._most_bytes:
            return
        _sync(path)
        generations = [
            path,
            *(path.with_name(f"{path.name}.{number}") for number in range(1, self._generations)),
        ]
        if len(generations) == 1:
            path.unlink()
        for newer, older in reversed(list(pairwise(generations))):
            if newer.exists():
                newer.replace(older)
        sync_directory(path.parent)

    def _lose(self, why: str) -> None:
        self.error = why
        self.lost += 1
        if self.lost % _COMPLAIN_EVERY == 1:
            _log.error("audit: %s; %d lines are lost so far", why, self.lost)


def line_of(action: ControlAction) -> str:
    """Returns a JSON object in one line of ASCII, whatever the caller sent.

    Several actions have their number in it, and the times of the first ones; several times of motion also how
    long and how far each of those was, and the newest.
    """
    fields: dict[str, str | int | list[str] | list[dict[str, float]]] = {
        "time": _timestamp(action.unix_s),
        "who": action.who,
        "role": action.role,
        "credential": action.credential,
        "address": action.address,
        "action": action.method,
        "request": action.request,
        "result": action.result.value,
        "answer": action.answer,
        "request_id": action.request_id,
    }
    if action.count > 1:
        fields |= {"count": action.count, "times": [_timestamp(each) for each in action.earlier_unix_s]}
    if action.motions:
        fields["motions"] = [_measures(each) for each in action.motions]
    return json.dumps(fields, ensure_ascii=True) + "\n"


def _measures(motion: Motion) -> dict[str, float]:
    """Returns its figures to the millisecond, millimetre and thousandth of a radian."""
    return {
        "duration_s": round(motion.duration_s, 3),
        "distance_m": round(motion.distance_m, 3),
        "turned_rad": round(motion.turned_rad, 3),
    }


def _timestamp(unix_s: float) -> str:
    return datetime.fromtimestamp(unix_s, UTC).isoformat(timespec="milliseconds")


def _sync(path: Path) -> None:
    """Makes the file's lines survive a power loss."""
    handle = os.open(path, os.O_WRONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _append(path: Path, line: bytes) -> None:
    """Appends the whole line or nothing of it, where a full disk would cut it."""
    handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, _FILE_MODE)
    try:
        before = os.fstat(handle).st_size
        written = os.write(handle, line)
        if written < len(line):
            os.ftruncate(handle, before)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        if before == 0:
            sync_directory(path.parent)
    finally:
        os.close(handle)
