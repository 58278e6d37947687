"""The ring: segments of a few seconds, kept for some minutes. A snapshot has hard links of them."""

import errno
import logging
import os
import re
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

from common.private_files import sync_directory
from recorder.mcap.reading import summarise
from recorder.mcap.records import PART
from recorder.mcap.recovery import is_untouched, recover
from recorder.store.folder import COPY, files_named, make_directory, segment_name
from recorder.store.manifest import Manifest
from recorder.store.room import is_full
from recorder.values import Gap, GapCause, SegmentSummary

_log = logging.getLogger(__name__)

SEGMENT_S: Final = 10.0
_MEASURED_NS: Final = int(SEGMENT_S * 1_000_000_000)
"""What is shorter counts as that long where the rate is measured."""
_NAME: Final = re.compile(r"\d{8}\.mcap")
_WITHOUT_LINKS: Final = (errno.EXDEV, errno.EPERM, errno.EMLINK, errno.EOPNOTSUPP)
"""link(2): between file systems, on one without hard links (FAT), or too many of one file already."""


@dataclass(frozen=True, slots=True)
class RingSegment:
    """One segment of the ring; instants of CLOCK_MONOTONIC in ns.

    Attributes:
        offset_ns: what its messages' calendar clock was ahead of that one.
    """

    number: int
    began_ns: int
    ended_ns: int
    offset_ns: int
    summary: SegmentSummary

    @property
    def path(self) -> Path:
        """Where it is."""
        return self.summary.path

    @property
    def first_message_ns(self) -> int | None:
        """When its first message was received; None without one."""
        first_ns = self.summary.first_ns
        return None if first_ns is None else first_ns - self.offset_ns

    def overlaps(self, from_ns: int, until_ns: int) -> bool:
        """Returns whether a part of it lies in a window, by its messages, which may have waited."""
        first_ns = self.first_message_ns
        began_ns = self.began_ns if first_ns is None else min(self.began_ns, first_ns)
        return self.ended_ns > from_ns and began_ns < until_ns


class Ring:
    """The final segments of the ring.

    Args:
        directory: where they are.
        seconds: how much is kept.
    """

    def __init__(self, directory: Path, seconds: int) -> None:
        self.directory = directory
        self._kept_ns = seconds * 1_000_000_000
        self._next_number = 0
        self._loaded_ns = 0
        self._left = 0
        """Segments with lower numbers are of a former process."""
        self._cut_ns: int | None = None
        """When a segment went for want of room."""
        self._damaged: set[int] = set()
        """Numbers of segments that lack messages, or all of them."""
        self.segments: list[RingSegment] = []

    @property
    def next_number(self) -> int:
        """The number of the segment to begin next."""
        return self._next_number

    @property
    def newest_ns(self) -> int:
        """The log time of the newest message; 0 without one."""
        lasts = [each.summary.last_ns for each in self.segments if each.summary.last_ns is not None]
        return max(lasts, default=0)

    @staticmethod
    def name(number: int) -> str:
        """Returns the file name of a segment."""
        return f"{number:08d}.mcap"

    def load(self) -> None:
        """Finds the segments that a former process has left; damaged ones are made whole as cut off ones are.

        Raises:
            OSError: the directory can't be read or written, or the disk is full.
        """
        make_directory(self.directory)
        self.segments, self._damaged = [], set()
        for path in files_named(self.directory, _NAME):
            self._take(path, summarise)
        self.recover()
        self._loaded_ns, self._left = time.monotonic_ns(), self._next_number

    def recover(self) -> list[RingSegment]:
        """Makes segments whole that were cut off, and returns them.

        Raises:
            OSError: the directory can't be read or written, or the disk is full.
        """
        make_directory(self.directory)
        found = [self._take(path, recover) for path in files_named(self.directory, _NAME, PART)]
        self.segments.sort(key=lambda each: each.number)
        return [segment for segment in found if segment]

    def losses(self) -> tuple[Gap, ...]:
        """Returns a gap wherever a segment does not follow the one before, from message to message.

        A number is missing where the ring was not written (`skip`), and where a segment was damaged beyond
        use. What the newest one has lost is part of the time since; without the oldest the ring reaches back
        less far.
        """
        gaps = []
        for one, following in pairwise(self.segments):
            damaged = self._damaged.intersection(range(one.number, following.number))
            if damaged or following.number > one.number + 1:
                cause = GapCause.DISK if damaged else GapCause.INTERRUPTED
                began_ns, ended_ns = one.summary.last_ns or 0, following.summary.first_ns or 0
                gaps.append(Gap("", cause, began_ns, max(began_ns, ended_ns), None))
        return tuple(gaps)

    def skip(self) -> None:
        """Leaves a number out: the next process, too, knows that the ring was not written meanwhile."""
        self._next_number += 1

    def add(self, segment: RingSegment) -> None:
        """Takes a segment that has become final."""
        self.segments.append(segment)
        self._next_number = max(self._next_number, segment.number + 1)

    def outdated(self, now_ns: int) -> list[RingSegment]:
        """Returns the segments that are older than what is kept.

        What a former process has left is kept for as long from the start on: it is what led to a power cut.
        """
        since_ns = now_ns - self._kept_ns
        return [each for each in self.segments if self._kept_from_ns(each) < since_ns]

    def drop(self, segment: RingSegment) -> None:
        """Deletes a segment; snapshots that have it keep it.

        Raises:
            OSError: the disk fails.
        """
        self.segments.remove(segment)
        segment.path.unlink(missing_ok=True)

    def give_up(self, segment: RingSegment) -> None:
        """Deletes a segment for want of room, and those before it: no snapshot knows of a hole.

        Raises:
            OSError: the disk fails.
        """
        if not self.is_short(now_ns := time.monotonic_ns()):
            _log.warning("%s has no room for all that the ring is to keep: it is shorter", self.directory)
        self._cut_ns = now_ns
        for each in self.segments[: self.segments.index(segment) + 1]:
            self.drop(each)

    def give_up_named(self, name: str) -> bool:
        """Gives up the segment whose file has that name; returns whether there was one.

        Raises:
            OSError: the disk fails.
        """
        found = [each for each in self.segments if each.path.name == name]
        for segment in found:
            self.give_up(segment)
        return bool(found)

    def is_short(self, now_ns: int) -> bool:
        """Returns whether it lacks something of what it is to keep, for want of room."""
        return self._cut_ns is not None and now_ns - self._cut_ns < self._kept_ns

    def full_bytes(self) -> int:
        """Returns what it takes when it holds all that is to be kept, by what it holds; 0 if unknown."""
        segments = list(self.segments)
        # A single one that was cut short says little.
        span_ns = max(sum(each.ended_ns - each.began_ns for each in segments), _MEASURED_NS)
        return sum(each.summary.size for each in segments) * self._kept_ns // span_ns

    def within(self, from_ns: int, until_ns: int) -> list[RingSegment]:
        """Returns the segments of which a part lies in a window, in order."""
        return [each for each in self.segments if each.overlaps(from_ns, until_ns)]

    def held_ns(self, now_ns: int) -> int:
        """Returns how far back the ring reaches, at most as far as is kept."""
        segments = list(self.segments)
        held_ns = now_ns - segments[0].began_ns if segments else 0
        return max(0, min(held_ns, self._kept_ns))

    def _kept_from_ns(self, segment: RingSegment) -> int:
        return self._loaded_ns if segment.number < self._left else segment.ended_ns

    def _take(self, path: Path, summary_of: Callable[[Path], SegmentSummary | None]) -> RingSegment | None:
        number = int(path.name[:8])
        self._next_number = max(self._next_number, number + 1)
        try:
            summary = summary_of(path)
            if summary is None or summary.first_ns is None or summary.last_ns is None:
                self._clear_away(path, number, damaged=summary is None)
                return None
        except OSError as error:
            if is_full(error):
                raise
            if not isinstance(error, FileExistsError):  # That one is there under its final name.
                self._damaged.add(number)
            _log.warning("%s can't be read and is left out of the ring: %s", path, error.strerror or error)
            return None
        # Its instants are known by the calendar clock alone: of the future where that was set back since.
        offset_ns = time.time_ns() - time.monotonic_ns()
        began_ns, ended_ns = summary.first_ns - offset_ns, summary.last_ns - offset_ns
        segment = RingSegment(number, began_ns, ended_ns, offset_ns, summary)
        self.segments.append(segment)
        return segment

    def _clear_away(self, path: Path, number: int, *, damaged: bool) -> None:
        """Deletes a segment without a message; reopens a final one that is damaged, for `recover`."""
        part = path.with_name(f"{self.name(number)}{PART}")
        if not damaged:
            path.unlink(missing_ok=True)
        elif path == part:
            if not is_untouched(part):
                self._damaged.add(number)
                _log.warning("%s is damaged beyond use and is deleted; snapshots have a gap for it", part)
            part.unlink(missing_ok=True)
        else:
            self._damaged.add(number)
            _log.warning("%s is damaged: what is left of it is made whole", path)
            path.replace(part)


def has_segments(folder: Path) -> bool:
    """Returns whether a folder has segments of a ring, or unfinished ones.

    Raises:
        OSError: it can't be read.
    """
    return any(_NAME.fullmatch(path.name.removesuffix(PART)) for path in folder.iterdir())


def link(source: Path, target: Path) -> None:
    """Gives a file a second name; a copy where the file system has none, or the two are in different ones.

    Raises:
        OSError: the disk is full or fails.
    """
    try:
        os.link(source, target)
    except OSError as error:
        if error.errno not in _WITHOUT_LINKS:
            raise
        _copy(source, target)
    try:
        sync_directory(target.parent)
    except OSError:
        target.unlink(missing_ok=True)  # So that the name is free for the next attempt.
        raise


def link_next(folder: Path, manifest: Manifest, segment: RingSegment) -> Manifest:
    """Links a segment of the ring as the next one of a snapshot, and returns the snapshot's manifest with it.

    Raises:
        OSError: the disk is full or fails.
    """
    name = segment_name(manifest.next_number)
    link(segment.path, folder / name)
    return manifest.with_segment(name, segment.summary)


def _copy(source: Path, target: Path) -> None:
    temporary = target.with_name(f".{target.name}{COPY}")
    try:
        shutil.copyfile(source, temporary)
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.rename(target)
    finally:
        temporary.unlink(missing_ok=True)
