"""One sequence of segments: a recording's, or the ring's. Used by the writer's thread alone."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from recorder.mcap.records import PART
from recorder.mcap.writer import SegmentWriter
from recorder.values import VIDEO_TOPIC, Channel, Gap, Item, Loss, Losses, Note, Sample, SegmentSummary

CLOCK_STEP_NS: Final = 500_000_000
"""A calendar clock that steps by more than this begins a new segment."""
_NS_PER_S: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Shape:
    """What an output takes, and how it is cut into segments.

    Attributes:
        directory: of the segments.
        name: of a segment's file, by its number.
        first: the number of its first segment.
        preset: what it records.
        with_video: whether it records the video, too.
        max_bytes, max_s: the longest segment.
    """

    directory: Path
    name: Callable[[int], str]
    first: int
    preset: str
    with_video: bool
    max_bytes: int
    max_s: float

    def selects(self, channel: Channel) -> bool:
        """Returns whether the messages of a channel belong here."""
        return self.with_video if channel.topic == VIDEO_TOPIC else self.preset in channel.presets


@dataclass(frozen=True, slots=True)
class Head:
    """What every segment begins with: the newest notes, and the newest messages of latched topics."""

    notes: Sequence[Note] = ()
    latched: Sequence[Sample] = ()


@dataclass(frozen=True, slots=True)
class Closed:
    """A segment that is final; instants of CLOCK_MONOTONIC in ns, from opening to closing.

    Attributes:
        offset_ns: what its messages' calendar clock was ahead of CLOCK_MONOTONIC.
    """

    path: Path
    number: int
    began_ns: int
    ended_ns: int
    offset_ns: int
    summary: SegmentSummary


@dataclass(frozen=True, slots=True)
class Progress:
    """How far an output has come.

    Attributes:
        part: the segment that is being written; None when there is none.
        part_bytes: its size so far.
        bytes: of all segments.
        messages, frames: written to all segments.
        losses: what is missing from them.
        last_ns: log time of the newest message; before the first, when the output was opened.
    """

    part: Path | None = None
    part_bytes: int = 0
    bytes: int = 0
    messages: int = 0
    frames: int = 0
    losses: Losses = field(default=Losses())
    last_ns: int = 0


class Output:
    """Writes what a shape selects to one segment after the other.

    Args:
        shape: what it takes.
        head: returns what every segment begins with.
        closed: called with each segment that has become final.
        after: the interruption before it; lasts until its first message, with which the file says it. None if
            there was none. It is no loss of this output.

    Attributes:
        progress: as of the newest flush; replaced as a whole, for other threads.
    """

    def __init__(
        self,
        shape: Shape,
        head: Callable[[], Head],
        closed: Callable[["Output", Closed], None],
        *,
        after: Gap | None = None,
    ) -> None:
        self.shape = shape
        self.progress = Progress()
        self._head = head
        self._closed = closed
        self._after = after
        self._number = shape.first
        self._segment: SegmentWriter | None = None
        self._path = Path()
        self._began_ns = 0
        self._head_bytes = 0
        """Of the present segment: a head that is longer than a segment must not end it at each message."""
        self._clock_offset_ns = 0
        self._closed_bytes = 0
        self._messages = 0
        self._frames = 0
        self._losses = Losses()
        self._last_ns = 0
        self._fresh = True
        """Whether nothing but its head is in the present segment."""

    def open(self) -> None:
        """Opens the next segment.

        Raises:
            OSError: the disk is full or fails.
        """
        now_ns, calendar_ns = time.monotonic_ns(), time.time_ns()
        self._path = self.shape.directory / self.shape.name(self._number)
        self._began_ns = now_ns
        self._last_ns = self._last_ns or calendar_ns
        self._clock_offset_ns = calendar_ns - now_ns
        pair = Note("clock", {"monotonic_ns": str(now_ns), "unix_ns": str(calendar_ns)})
        head = self._head()
        part = self._path.with_name(self._path.name + PART)
        self._segment = SegmentWriter(part, head=(pair, *head.notes))
        self._fresh = True
        for sample in head.latched:
            if self.shape.selects(sample.channel):
                # As of now: its own instant may lie hours before the segment.
                self._segment.write(replace(sample, log_time_ns=calendar_ns, monotonic_ns=now_ns))
                self._messages += 1
        self._head_bytes = self._segment.size
        self._report()

    def write(self, item: Item) -> None:
        """Writes a message, a loss or a note, if it belongs here.

        Raises:
            OSError: the disk is full or fails.
        """
        match item:
            case Sample():
                if self.shape.selects(item.channel):
                    self._write(item)
            case Loss():
                if item.channel is None or self.shape.selects(item.channel):
                    self._lose(item)
            case Note():
                self._opened.note(item)

    def flush(self) -> None:
        """Writes what is buffered to the disk, and begins a new segment when the present one is long enough.

        Raises:
            OSError: the disk is full or fails.
        """
        segment = self._opened
        segment.flush()
        age_ns = time.monotonic_ns() - self._began_ns
        if age_ns >= self.shape.max_s * _NS_PER_S and not self._fresh:
            self.rotate()
        self._report()

    def rotate(self) -> None:
        """Makes the present segment final and opens the next one.

        Raises:
            OSError: the disk is full or fails.
        """
        self.close()
        self.open()

    def close(self) -> None:
        """Makes the present segment final.

        Raises:
            OSError: the disk is full or fails; the segment stays as it is.
        """
        summary = self._opened.finish()
        self._segment = None
        self._closed_bytes += summary.size
        self._report()
        ended_ns = time.monotonic_ns()
        final = Closed(summary.path, self._number, self._began_ns, ended_ns, self._clock_offset_ns, summary)
        self._number += 1
        self._closed(self, final)

    def abandon(self) -> None:
        """Lets go of the present segment after an error; its file is left for recovery."""
        if self._segment:
            self._segment.abandon()
            self._segment = None

    @property
    def _opened(self) -> SegmentWriter:
        if self._segment is None:
            self.open()
        assert self._segment is not None, "open() raises or opens"  # noqa: S101  # for the type checker
        return self._segment

    def _write(self, sample: Sample) -> None:
        segment = self._opened
        offset_ns = sample.log_time_ns - sample.monotonic_ns
        if abs(offset_ns - self._clock_offset_ns) > CLOCK_STEP_NS:
            self.rotate()
            # By the sample's own pair: more of the old clock's may wait in the queue.
            self._clock_offset_ns = offset_ns
            segment = self._opened
        elif segment.size - self._head_bytes >= self.shape.max_bytes:
            self.rotate()
            segment = self._opened
        if self._after:
            gap, self._after = self._after, None
            ended_ns = max(gap.ended_ns, sample.log_time_ns)
            segment.loss(Loss(None, gap.cause, gap.began_ns, ended_ns, gap.messages))
        segment.write(sample)
        self._fresh = False
        self._messages += 1
        self._last_ns = sample.log_time_ns
        if sample.channel.topic == VIDEO_TOPIC:
            self._frames += 1
        elif not sample.sequence and self._losses.numbered:
            self._losses = replace(self._losses, numbered=False)

    def _lose(self, loss: Loss) -> None:
        self._opened.loss(loss)
        self._fresh = False
        self._losses = self._losses.with_loss(loss.cause, loss.messages)

    def _report(self) -> None:
        size = self._segment.size if self._segment else 0
        self.progress = Progress(
            part=self._path if self._segment else None,
            part_bytes=size,
            bytes=self._closed_bytes + size,
            messages=self._messages,
            frames=self._frames,
            losses=self._losses,
            last_ns=self._last_ns,
        )
