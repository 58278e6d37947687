"""The ring: segments of a few seconds, kept for some minutes. A snapshot has hard links of them."""

import errno
import os
import re
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from common.private_files import sync_directory
from recorder.mcap.reading import summarise
from recorder.mcap.records import PART
from recorder.mcap.recovery import recover
from recorder.store.folder import files_named, make_directory, segment_name
from recorder.store.manifest import Manifest
from recorder.values import SegmentSummary

SEGMENT_S: Final = 10.0
_NAME: Final = re.compile(r"\d{8}\.mcap")


@dataclass(frozen=True, slots=True)
class RingSegment:
    """One segment of the ring; instants of CLOCK_MONOTONIC in ns."""

    number: int
    began_ns: int
    ended_ns: int
    summary: SegmentSummary

    @property
    def path(self) -> Path:
        """Where it is."""
        return self.summary.path

    def overlaps(self, from_ns: int, until_ns: int) -> bool:
        """Returns whether a part of it lies in a window."""
        return self.ended_ns > from_ns and self.began_ns < until_ns


class Ring:
    """The final segments of the ring.

    Args:
        directory: where they are.
        seconds: how much is kept.
    """

    def __init__(self, directory: Path, seconds: int) -> None:
        self.directory = directory
        self._kept_ns = seconds * 1_000_000_000
        self.segments: list[RingSegment] = []

    @property
    def next_number(self) -> int:
        """The number of the segment to begin next."""
        return self.segments[-1].number + 1 if self.segments else 0

    @staticmethod
    def name(number: int) -> str:
        """Returns the file name of a segment."""
        return f"{number:08d}.mcap"

    def load(self) -> None:
        """Finds the segments that a former process has left.

        Raises:
            OSError: the directory can't be read or written.
        """
        make_directory(self.directory)
        self.segments = []
        for path in files_named(self.directory, _NAME):
            self._take(path, summarise(path))
        self.recover()

    def recover(self) -> list[RingSegment]:
        """Makes segments whole that were cut off, and returns them.

        Raises:
            OSError: the directory can't be read or written.
        """
        found = [self._take(path, recover(path)) for path in files_named(self.directory, _NAME, PART)]
        self.segments.sort(key=lambda each: each.number)
        return [segment for segment in found if segment]

    def add(self, segment: RingSegment) -> None:
        """Takes a segment that has become final."""
        self.segments.append(segment)

    def outdated(self, now_ns: int) -> list[RingSegment]:
        """Returns the segments that are older than what is kept."""
        return [each for each in self.segments if each.ended_ns < now_ns - self._kept_ns]

    def drop(self, segment: RingSegment) -> None:
        """Deletes a segment; snapshots that have it keep it.

        Raises:
            OSError: the disk fails.
        """
        self.segments.remove(segment)
        segment.path.unlink(missing_ok=True)

    def within(self, from_ns: int, until_ns: int) -> list[RingSegment]:
        """Returns the segments of which a part lies in a window, in order."""
        return [each for each in self.segments if each.overlaps(from_ns, until_ns)]

    def held_ns(self, now_ns: int) -> int:
        """Returns how far back the ring reaches."""
        segments = list(self.segments)
        return now_ns - segments[0].began_ns if segments else 0

    def _take(self, path: Path, summary: SegmentSummary | None) -> RingSegment | None:
        if summary is None or summary.first_ns is None or summary.last_ns is None:
            path.unlink(missing_ok=True)  # Without a message, or damaged beyond use.
            return None
        # Its instants are known by the calendar clock alone.
        offset_ns = time.monotonic_ns() - time.time_ns()
        segment = RingSegment(
            int(path.name[:8]), summary.first_ns + offset_ns, summary.last_ns + offset_ns, summary
        )
        self.segments.append(segment)
        return segment


def link(source: Path, target: Path) -> None:
    """Gives a file a second name; a copy where the two are in different file systems.

    Raises:
        OSError: the disk is full or fails.
    """
    try:
        os.link(source, target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        _copy(source, target)
    sync_directory(target.parent)


def link_next(folder: Path, manifest: Manifest, segment: RingSegment) -> Manifest:
    """Links a segment of the ring as the next one of a snapshot, and returns the snapshot's manifest with it.

    Raises:
        OSError: the disk is full or fails.
    """
    name = segment_name(manifest.next_number)
    link(segment.path, folder / name)
    return manifest.with_segment(name, segment.summary)


def _copy(source: Path, target: Path) -> None:
    temporary = target.with_name(f".{target.name}.copy")
    try:
        shutil.copyfile(source, temporary)
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.rename(target)
    finally:
        temporary.unlink(missing_ok=True)
