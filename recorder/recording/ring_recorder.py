"""Records the ring: the last minutes, which snapshots and incidents are made of."""

import asyncio
import logging
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from recorder.config import RecorderSettings
from recorder.recording.outputs import Outputs
from recorder.recording.retries import Retries
from recorder.recording.snapshots import Snapshots
from recorder.store.housekeeping import attempt
from recorder.store.outages import Outages
from recorder.store.ring import SEGMENT_S, Ring, RingSegment
from recorder.values import GapCause
from recorder.writing.output import Closed, Output, Shape
from recorder.writing.writer import Writer

_log = logging.getLogger(__name__)

_NS_PER_S: Final = 1_000_000_000


class RingRecorder:
    """The ring of a recorder, which calls it under its lock.

    Args:
        settings: of the program; `ring.preset` is set.
        ring: its segments.
        outputs: has the ring's, but while it can't be written.
        writer: writes the ring.
        outages: get those of the ring.
        snapshots: are made of it, and get its segments.

    Attributes:
        problem: why it can't be written, for people; empty if it can.
        retries: of the ring, whatever becomes of recordings meanwhile.
        snapshots: the same.
    """

    def __init__(
        self,
        settings: RecorderSettings,
        ring: Ring,
        outputs: Outputs,
        writer: Writer,
        *,
        outages: Outages,
        snapshots: Snapshots,
    ) -> None:
        self._settings = settings
        self._preset = settings.ring.preset or ""
        self._ring = ring
        self._outputs = outputs
        self._writer = writer
        self._outages = outages
        self.snapshots = snapshots
        self.problem = ""
        self.retries = Retries(time.monotonic)

    @property
    def directory(self) -> Path:
        """Of its segments."""
        return self._ring.directory

    @property
    def held_s(self) -> int:
        """Seconds that the ring holds."""
        return int(self._ring.held_ns(time.monotonic_ns()) / _NS_PER_S)

    @property
    def short(self) -> bool:
        """Whether it holds less than it is to keep, for want of room."""
        return self._ring.is_short(time.monotonic_ns())

    def shape(self) -> Shape:
        """Returns the shape of the ring's next output."""
        return Shape(
            self._ring.directory,
            self._ring.name,
            self._ring.next_number,
            self._preset,
            self._settings.records_video(self._preset),
            self._settings.segments.max_bytes,
            SEGMENT_S,
        )

    async def open(self, closed: Callable[[Output, Closed], None]) -> None:
        """Begins to record, after what a failure has cut off is whole.

        Raises:
            OSError: the disk is full or fails.
        """
        for segment in await asyncio.to_thread(self._ring.recover):
            await self.snapshots.link(segment)
        if not self._outages.known and self._ring.newest_ns:
            # A former process has left it.
            self._outages.add(self._ring.losses())
            self._outages.begin(GapCause.INTERRUPTED, self._ring.newest_ns)
        outage = self._outages.present
        if outage:
            self._ring.skip()
        output = Output(self.shape(), self._writer.head, closed, after=outage)
        await asyncio.wrap_future(self._writer.add(output))
        self._outputs.ring = output
        self._outages.end(time.time_ns())
        self.problem = ""

    def fail(self, error: OSError) -> None:
        """Takes note that the disk has failed it; snapshots of this time have a gap."""
        output, self._outputs.ring = self._outputs.ring, None
        self.problem = f"the ring can't be written: {error.strerror}; it is tried again by itself"
        self.retries.failed()
        _log.error("%s (attempt %d)", self.problem, self.retries.failures)
        self._outages.begin(GapCause.DISK, output.progress.last_ns if output else time.time_ns())

    async def close(self) -> None:
        """Makes the last segment final."""
        if output := self._outputs.ring:
            self._outputs.ring = None
            await asyncio.wrap_future(self._writer.remove(output))

    async def rotate(self) -> None:
        """Makes the present segment final, so that snapshots can have it."""
        if output := self._outputs.ring:
            await asyncio.wrap_future(self._writer.rotate(output))

    async def take(self, closed: Closed) -> None:
        """Takes a segment that has become final: the disk takes the ring."""
        self.retries.succeeded()
        segment = RingSegment(
            closed.number, closed.began_ns, closed.ended_ns, closed.offset_ns, closed.summary
        )
        self._ring.add(segment)
        await self.snapshots.link(segment)

    async def drop_outdated(self) -> None:
        """Deletes the segments that are older than what is kept."""
        for segment in self._ring.outdated(time.monotonic_ns()):
            await attempt("a segment of the ring stays", partial(self._ring.drop, segment))
