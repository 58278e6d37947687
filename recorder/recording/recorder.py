"""The recorder's own lifecycle: recovers, records until it is stopped, keeps room, closes in order."""

import asyncio
import logging
import time
from collections.abc import Callable, Collection
from typing import Final, Literal

from recorder.recording.assembly import Parts
from recorder.recording.lifecycle import Event, State
from recorder.recording.reports import Failed, Finished
from recorder.recording.retries import Retries
from recorder.recording.status_reader import StatusReader
from recorder.store.housekeeping import LEAST_ROOM, attempt
from recorder.store.manifest import Manifest, RecordingState, StopReason
from recorder.store.room import is_full
from recorder.store.salvage import salvage, with_interruption

_log = logging.getLogger(__name__)

_TICK_S: Final = 0.5
_ROOM_EVERY_S: Final = 2.0
_AHEAD_S: Final = 5.0
"""Room is made for what the next seconds take, before it is gone."""


class Recorder:
    """Runs the parts; used on one event loop. Work on the disk runs in threads, one change after the other.

    Args:
        parts: of the recorder.
        status_reader: of the same.

    Attributes:
        changing: held by whatever changes something.
        ending: whether nothing may be begun any more.
    """

    def __init__(self, parts: Parts, status_reader: StatusReader) -> None:
        self._parts = parts
        self._status_reader = status_reader
        self._lifecycle = parts.lifecycle
        self._manual = parts.manual
        self._ring = parts.ring
        self._outputs = parts.outputs
        self._loop = asyncio.get_running_loop()
        self._loaded = False
        self._room_at_s = 0.0
        self._notified: object = None
        self._deletions = Retries(self._loop.time)
        self._manifests = Retries(self._loop.time)
        self._completions = Retries(self._loop.time)
        self.changing = asyncio.Lock()
        self.ending = False

    async def run(self, stop: asyncio.Event) -> None:
        """Recovers what was cut off, records until `stop`, and closes everything in order.

        Raises:
            RuntimeError: a defect has ended the writer.
        """
        self._parts.writer.start()
        ends = asyncio.ensure_future(stop.wait())
        try:
            async with self.changing:
                await self._begin()
            while not stop.is_set():
                await self._rest(ends)
                async with self.changing:
                    await self._tick()
                self._notify()
            async with self.changing:
                await self._shut_down()
        finally:
            ends.cancel()
            await asyncio.to_thread(self._parts.writer.stop)

    async def take_reports(self) -> None:
        """Takes what the writer has reported."""
        for report in self._parts.reports.take():
            match report:
                case Failed(output, error) if output is self._outputs.recording:
                    await self._manual.fail(error)
                case Failed(output, error) if output is self._outputs.ring:
                    self._ring_failed(error)
                case Finished(output, closed) if output is self._outputs.recording:
                    await self._manual.take(closed)
                case Finished(_, closed) if self._ring and closed.path.parent == self._ring.directory:
                    await self._ring.take(closed)
                    if self._lifecycle.state is not State.FAULTED:
                        self._lifecycle.retries.succeeded()

    async def end(self, reason: StopReason) -> None:
        """Ends the running recording."""
        closed = await self._manual.close()
        await self.take_reports()
        if closed:
            await self._manual.complete(reason)

    async def finish_snapshots(
        self, recording_ids: list[str], reason: StopReason = StopReason.REQUESTED
    ) -> None:
        """Ends snapshots, with what has come by now."""
        if self._ring and recording_ids:
            await self._parts.sources.caught_up()
            await self._ring.rotate()
            await self.take_reports()
            for each in recording_ids:
                await self._ring.snapshots.finish(each, reason)

    # --- from the start to the end ---

    async def _begin(self) -> None:
        """Reads the disk, recovers what was cut off, and goes on with what ran; also after a fault."""
        try:
            goes_on = await self._load()
        except OSError as error:
            self._lifecycle.fault(f"the folder of recordings can't be read or written: {error.strerror}")
            return
        self._loaded = True
        await self._parts.housekeeping.measure()
        if self._lifecycle.state is State.RECOVERING:
            self._lifecycle.move(Event.RECOVERED)
        else:
            self._lifecycle.clear()
        if goes_on:
            # At once: no client may see an idle recorder between the two.
            await self._go_on(goes_on)
        await self._open_ring()

    async def _load(self) -> Manifest | None:
        """Reads the disk and makes whole what was cut off; where it is full, after room has been made."""
        await asyncio.to_thread(self._read)
        try:
            goes_on = await asyncio.to_thread(self._salvage)
        except OSError as error:
            if not is_full(error):
                raise
            await self._parts.housekeeping.make_room(LEAST_ROOM)
            goes_on = await asyncio.to_thread(self._salvage)
        await asyncio.to_thread(self._take_reserve)
        return goes_on

    def _read(self) -> None:
        # Making whole needs some room, and the disk may have no other.
        self._parts.reserve.give()
        self._parts.catalogue.load()
        self._parts.state_file.load()

    def _salvage(self) -> Manifest | None:
        parts = self._parts
        if parts.segments:
            try:
                parts.segments.load()
            except OSError as error:  # It is opened, and tried again, apart from the recordings.
                _log.error("what was left of the ring can't be read: %s", error)
        return salvage(parts.catalogue, parts.segments, parts.boot_id)

    def _take_reserve(self) -> None:
        """Shows whether the disk can be written. A full one can: a recording that begins makes room."""
        try:
            self._parts.reserve.take()
        except OSError as error:
            if not is_full(error):
                raise
            _log.warning("the disk is full: no space is reserved for closing files")

    async def _go_on(self, manifest: Manifest) -> None:
        """Continues a recording that a former process of the same boot has left."""
        _log.warning("recording %s was cut off and goes on", manifest.id)
        if manifest.preset not in self._parts.settings.presets:
            manifest = manifest.model_copy(update={"stop_reason": StopReason.INTERRUPTED})
            await self._manual.make_whole(manifest.model_copy(update={"state": RecordingState.RECOVERED}))
            return
        self._lifecycle.move(Event.START)
        interrupted = with_interruption(manifest, time.time_ns())
        await self._manual.open(interrupted, self._parts.reports.closed, after=interrupted.gaps[-1])

    async def _rest(self, ends: "asyncio.Task[Literal[True]]") -> None:
        """Returns when there is something to do."""
        wake = self._parts.reports.wake
        due_s = self._ring.snapshots.next_due_s if self._ring else None
        pause_s = _TICK_S if due_s is None else max(0.0, min(_TICK_S, due_s))
        woken = asyncio.ensure_future(wake.wait())
        await asyncio.wait({ends, woken}, timeout=pause_s, return_when=asyncio.FIRST_COMPLETED)
        woken.cancel()
        wake.clear()

    async def _tick(self) -> None:
        now_s = self._loop.time()
        self._check_writer()
        await self.take_reports()
        await self._try_again()
        catalogue = self._parts.catalogue
        for otherwise, behind, work, retries in (
            ("files of deleted recordings stay", catalogue.cut_off, catalogue.end_deletions, self._deletions),
            ("manifests are not on the disk", catalogue.unwritten, catalogue.write_again, self._manifests),
        ):
            await _caught_up(otherwise, behind, work, retries)
        if self._manual.at_its_limit:
            await self.end(StopReason.LIMIT)
        if self._ring:
            await self.finish_snapshots(self._ring.snapshots.due())
            await self._ring.drop_outdated()
        self._outputs.measure(now_s)
        if now_s >= self._room_at_s:
            self._room_at_s = now_s + _ROOM_EVERY_S
            await self._keep_room()

    def _check_writer(self) -> None:
        if not self._parts.writer.alive:
            raise RuntimeError("the writer has ended by a defect; see above")

    def _notify(self) -> None:
        """Wakes the watchers if there is something new, also from other threads and the sources."""
        key = self._status_reader.change_key
        if key != self._notified:
            self._notified = key
            self._lifecycle.changes.notify_all()

    async def _shut_down(self) -> None:
        self.ending = True
        await self.take_reports()
        if self._ring:
            await self.finish_snapshots(self._ring.snapshots.due(all_of_them=True), StopReason.SHUTDOWN)
        if self._lifecycle.state is State.RECORDING:
            await self.end(StopReason.SHUTDOWN)
        if self._ring:
            await self._ring.close()
            await self.take_reports()
        self._parts.sources.want(frozenset(), video=False)
        # It may have ended after the last tick, and while nothing was recorded any more.
        self._check_writer()

    # --- the disk ---

    async def _try_again(self) -> None:
        """Tries what the disk has failed, each thing after its own pause."""
        if self._lifecycle.state is State.FAULTED:
            if self._lifecycle.retries.due:
                await self._retry()
        elif self._ring and self._ring.retries.due and not self._outputs.ring:
            # A full disk may need its own room.
            await self._parts.housekeeping.make_room(LEAST_ROOM, recordings=False)
            await self._parts.housekeeping.make_ring_room(LEAST_ROOM)
            await self._open_ring()
        if self._lifecycle.state is not State.FAULTED and self._completions.due:
            await self._complete_faulted()

    async def _retry(self) -> None:
        """Tries whether the disk takes data again."""
        if not self._loaded:
            await self._begin()
            return
        try:
            await self._parts.housekeeping.make_room(LEAST_ROOM)
            await asyncio.to_thread(self._parts.reserve.take)
        except OSError as error:
            self._lifecycle.fault(f"the disk can't be written: {error.strerror}; make room or check it")
            return
        await self._complete_faulted()
        self._lifecycle.clear()
        _log.info("the disk takes data again")
        await self._open_ring()

    async def _complete_faulted(self) -> None:
        """Makes recordings and snapshots whole that the disk has refused at their end."""
        incomplete = self._incomplete
        if not incomplete:
            return
        for manifest in incomplete:
            await self._manual.make_whole(manifest)
        if self._incomplete:
            self._completions.failed()
        else:
            self._completions.succeeded()

    @property
    def _incomplete(self) -> list[Manifest]:
        """What is to be made whole; not what the disk refuses to read, which the next start tries again."""
        return [
            each
            for each in self._parts.catalogue.all.values()
            if each.state is RecordingState.FAULTED
            and each.metadata is None
            and each.id not in self._parts.catalogue.problems
        ]

    async def _keep_room(self) -> None:
        """Makes room for what is written. The ring alone deletes no recording: it gives way itself.

        What it lacks is left for it while recordings are written, which may delete older ones.
        """
        housekeeping = self._parts.housekeeping
        await housekeeping.measure(exact=False)
        need = max(LEAST_ROOM, int(self._outputs.bytes_per_s * _AHEAD_S))
        if self._outputs.ring:
            await housekeeping.make_ring_room(need)
        recordings = self._outputs.recording is not None
        wanted = need + (housekeeping.ring_claim if recordings else 0)
        if not self._outputs.all or housekeeping.room.bytes >= wanted:
            return
        if await housekeeping.make_room(need, recordings=recordings):
            return
        if self._lifecycle.state is State.RECORDING:
            await self.end(StopReason.DISK)
            self._lifecycle.stopped_for_room()
        elif self._ring:
            await self.finish_snapshots(self._ring.snapshots.due(all_of_them=True), StopReason.DISK)

    async def _open_ring(self) -> None:
        faulted = self._lifecycle.state in (State.FAULTED, State.RECOVERING)
        if self._ring is None or self._outputs.ring or faulted:
            return
        try:
            await self._ring.open(self._parts.reports.closed)
        except OSError as error:
            self._ring_failed(error)

    def _ring_failed(self, error: OSError) -> None:
        assert self._ring, "it has failed"  # noqa: S101  # for the type checker
        self._ring.fail(error)
        # A full disk is no fault: a recording that begins may delete older ones, which the ring may not.
        if self._lifecycle.state is State.IDLE and not is_full(error):
            self._lifecycle.fault(self._ring.problem)


async def _caught_up(
    otherwise: str, behind: Collection[object], work: Callable[[], bool], retries: Retries
) -> None:
    """Goes on with what the disk has failed, when it is due.

    Args:
        otherwise: what follows where it fails again, for the log.
        behind: what is outstanding.
        work: does it.
        retries: of this work.
    """
    if not behind or not retries.due:
        return
    if await attempt(otherwise, work):
        retries.succeeded()
    else:
        retries.failed()
