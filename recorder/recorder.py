"""Owns what is recorded: the lifecycle, the running recording, the ring, snapshots, room on the disk."""

import asyncio
import errno
import logging
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

from common.backoff import Backoff
from common.broadcast import Broadcast
from common.errors import InvalidRequestError, NotFoundError, PreconditionError
from common.reasons import Reason
from recorder.config import RecorderSettings
from recorder.lifecycle import Event, Phase, State, step
from recorder.requests import Live, Result, SnapshotOptions, StartOptions
from recorder.ring_recorder import RingRecorder
from recorder.store.catalogue import Catalogue
from recorder.store.folder import DATA, new_id, segment_name
from recorder.store.housekeeping import LEAST_ROOM, Housekeeping, Room, attempt
from recorder.store.manifest import Copy, Kind, Manifest, RecordingState, StopReason
from recorder.store.ring import Ring
from recorder.store.room import Reserve
from recorder.store.salvage import ended, salvage, whole, with_interruption
from recorder.store.state_file import Answer, StateFile
from recorder.values import Gap, GapCause
from recorder.writing.output import Closed, Output, Progress, Shape
from recorder.writing.queue import SampleQueue
from recorder.writing.writer import Latched, Writer

_log = logging.getLogger(__name__)

NEWEST_ENDED: Final = 16
_TICK_S: Final = 0.5
_ROOM_EVERY_S: Final = 2.0
_STOP_WAIT_S: Final = 10.0
_AHEAD_S: Final = 5.0
"""Room is made for what the next seconds take, before it is gone."""
_SHORT_S: Final = 3600.0
_MEASURED_S: Final = 10.0
"""A shorter recording says little about what its preset takes."""
_FULL: Final = (errno.ENOSPC, errno.EDQUOT)
_NS_PER_S: Final = 1_000_000_000
_NS_PER_MS: Final = 1_000_000


class Sources(Protocol):
    """What takes messages and puts them into the queue."""

    @property
    def problem(self) -> str:
        """What keeps something wanted from being recorded, for people; empty if nothing does."""

    def want(self, presets: frozenset[str], *, video: bool) -> None:
        """Takes the topics of these presets, and the video, from now on; everything else no longer."""

    async def caught_up(self) -> None:
        """Returns when everything that has come by now is in the queue, or after a bounded time."""


@dataclass(frozen=True, slots=True)
class _Failed:
    output: Output
    error: OSError


class Recorder:
    """The recorder; used on one event loop. Work on the disk runs in threads, one change after the other.

    Args:
        settings: of the program.
        queue: what `sources` fill.
        sources: what takes messages.
        latched: what the head of each segment repeats.
        boot_id: of the computer; empty if unknown.
        run_id: random for every process.

    Attributes:
        changes: notified of every change.
    """

    def __init__(
        self,
        settings: RecorderSettings,
        queue: SampleQueue,
        sources: Sources,
        latched: Latched,
        *,
        boot_id: str,
        run_id: str,
    ) -> None:
        self._settings = settings
        self._queue = queue
        self._sources = sources
        self._boot_id = boot_id
        self.run_id = run_id
        self.changes = Broadcast()
        self._catalogue = Catalogue(settings.root)
        self._state_file = StateFile(settings.root)
        self._reserve = Reserve(settings.root)
        self._writer = Writer(queue, latched, self._on_failed)
        kept = settings.ring
        self._segments = Ring(settings.ring_directory, kept.seconds) if kept.preset else None
        self._housekeeping = Housekeeping(settings, self._catalogue, self._segments)
        self._ring: RingRecorder | None = None
        if self._segments:
            self._ring = RingRecorder(
                settings,
                self._segments,
                self._catalogue,
                self._housekeeping,
                self._writer,
                boot_id=boot_id,
                run_id=run_id,
            )
        self._loop = asyncio.get_running_loop()
        self._phase = Phase(State.RECOVERING, self._loop.time())
        self._backoff = Backoff(1.0, 30.0)
        self._retry_at_s = 0.0
        self._changing = asyncio.Lock()
        self._happened: deque[tuple[Output, Closed] | _Failed] = deque()
        self._wake = asyncio.Event()
        self._loaded = False
        self._running: Manifest | None = None
        self._output: Output | None = None
        self._newest = ""
        self._stopped_by_disk = False
        self._last_error = ""
        self._room_at_s = 0.0
        self.bytes_per_s = 0
        self._rate_from: tuple[float, int] = (0.0, 0)

    # --- what others read ---

    @property
    def phase(self) -> Phase:
        """The lifecycle's state."""
        return self._phase

    @property
    def last_error(self) -> str:
        """Why it can't record, or not all of what is wanted; empty when all is well."""
        return self._last_error or self._sources.problem

    @property
    def running(self) -> Manifest | None:
        """The recording that runs."""
        return self._running

    @property
    def newest(self) -> Manifest | None:
        """The recording that runs or has ended last; None before the first of this process."""
        return self._running or self._catalogue.get(self._newest)

    @property
    def recordings(self) -> list[Manifest]:
        """All recordings, the newest first."""
        return sorted(self._catalogue.all.values(), key=lambda each: each.id, reverse=True)

    @property
    def recently_ended(self) -> list[Manifest]:
        """The recordings that ended last, the newest first."""
        done = [each for each in list(self._catalogue.all.values()) if not each.state.open]
        return sorted(done, key=lambda each: each.ended_unix_ms, reverse=True)[:NEWEST_ENDED]

    @property
    def room(self) -> Room:
        """The disk, as measured last."""
        return self._housekeeping.room

    @property
    def bytes_per_minute(self) -> dict[str, int]:
        """What each preset took when it was last recorded."""
        return dict(self._state_file.bytes_per_minute)

    @property
    def snapshots_pending(self) -> int:
        """Snapshots that are being made."""
        return self._ring.pending if self._ring else 0

    @property
    def ring_s(self) -> int:
        """Seconds that the ring holds."""
        return self._ring.held_s if self._ring else 0

    @property
    def ring_part_bytes(self) -> int:
        """Size of the ring's segment that is being written."""
        output = self._ring.output if self._ring else None
        return output.progress.part_bytes if output else 0

    @property
    def dropped(self) -> int:
        """Messages dropped because the queue was full."""
        return self._queue.dropped

    @property
    def lost(self) -> int | None:
        """Messages lost since the process started, where that is known."""
        outputs = self._outputs
        counts = [each.progress.lost if each.progress.numbered else None for each in outputs]
        known = [count for count in counts if count is not None]
        return None if len(known) < len(counts) else max(known, default=0)

    @property
    def room_s(self) -> float | None:
        """How long the room lasts at the present rate; None while no recording is written."""
        return max(self.room.bytes, 0) / self.bytes_per_s if self._output and self.bytes_per_s else None

    @property
    def disk_short(self) -> bool:
        """Whether room is short within an hour, or has ended a recording."""
        room_s = self.room_s
        return self._stopped_by_disk or (room_s is not None and room_s < _SHORT_S)

    def live(self, manifest: Manifest) -> Live:
        """Returns how far a recording has come, including what of it is not final yet."""
        output = self._output if self._running and self._running.id == manifest.id else None
        ended_ns = manifest.ended_monotonic_ns
        if manifest.state.open and manifest.boot_id == self._boot_id:
            ended_ns = ended_ns or time.monotonic_ns()
        length_ms = (ended_ns - manifest.started_monotonic_ns) // _NS_PER_MS if ended_ns else 0
        calendar_ms = manifest.ended_unix_ms - manifest.started_unix_ms
        duration_ms = max(length_ms or calendar_ms, 0)
        if output is None:
            return Live(duration_ms, manifest.messages, manifest.video_frames, manifest.lost)
        before = manifest.before(output.shape.first)
        progress = output.progress
        lost = progress.lost if progress.numbered and before.lost is not None else None
        return Live(
            duration_ms,
            before.messages + progress.messages,
            before.video_frames + progress.frames,
            None if lost is None else lost + (before.lost or 0),
            segment_name(int(progress.part.stem)) if progress.part else "",
            progress.part_bytes,
        )

    @property
    def writes(self) -> bool:
        """Whether anything is written at present."""
        return bool(self._outputs)

    def has(self, recording_id: str) -> bool:
        """Returns whether there is such a recording."""
        return self._catalogue.get(recording_id) is not None

    def get(self, recording_id: str) -> Manifest:
        """Returns a recording.

        Raises:
            NotFoundError: there is no such.
        """
        found = self._catalogue.get(recording_id)
        if found is None:
            raise NotFoundError(
                f"there is no recording '{recording_id}'; ListRecordings has those there are",
                Reason.RECORDING_NOT_FOUND,
            )
        return found

    def folder_of(self, manifest: Manifest) -> Path:
        """Returns the folder of a recording."""
        return self._catalogue.folder_of(manifest)

    # --- its own life ---

    async def run(self, stop: asyncio.Event) -> None:
        """Recovers what was cut off, records until `stop`, and closes everything in order.

        Raises:
            RuntimeError: a defect has ended the writer.
        """
        self._writer.start()
        ends = asyncio.ensure_future(stop.wait())
        try:
            async with self._changing:
                await self._begin()
            while not stop.is_set():
                woken = asyncio.ensure_future(self._wake.wait())
                await asyncio.wait(
                    {ends, woken}, timeout=self._pause_s(), return_when=asyncio.FIRST_COMPLETED
                )
                woken.cancel()
                self._wake.clear()
                async with self._changing:
                    await self._tick()
                self.changes.notify_all()
            async with self._changing:
                await self._shut_down()
        finally:
            ends.cancel()
            await asyncio.to_thread(self._writer.stop)

    async def _begin(self) -> None:
        """Reads the disk, recovers what was cut off, and goes on with what ran; also after a fault."""
        event = Event.RECOVERED if self._phase.state is State.RECOVERING else Event.CLEARED
        try:
            goes_on = await asyncio.to_thread(self._load)
        except OSError as error:
            self._fault(f"the folder of recordings can't be read or written: {error.strerror}")
            return
        self._loaded = True
        await self._housekeeping.measure()
        self._move(event)
        if goes_on:
            # At once: no client may see an idle recorder between the two.
            await self._go_on(goes_on)
        await self._open_ring()

    def _load(self) -> Manifest | None:
        """Reads the disk; in a thread."""
        self._catalogue.load()
        self._state_file.load()
        if self._segments:
            self._segments.load()
        ring = self._segments.segments if self._segments else ()
        goes_on = salvage(self._catalogue, ring, self._boot_id)
        self._reserve.take()
        return goes_on

    async def _go_on(self, manifest: Manifest) -> None:
        """Continues a recording that a former process of the same boot has left."""
        _log.warning("recording %s was cut off and goes on", manifest.id)
        if manifest.preset not in self._settings.presets:
            manifest = manifest.model_copy(update={"stop_reason": StopReason.INTERRUPTED})
            await self._make_whole(manifest.model_copy(update={"state": RecordingState.RECOVERED}))
            return
        self._move(Event.START)
        await self._open(with_interruption(manifest, time.time_ns()))

    async def _tick(self) -> None:
        now_s = self._loop.time()
        if not self._writer.alive:
            raise RuntimeError("the writer has ended by a defect; see above")
        await self._take_happened()
        if self._phase.state is State.FAULTED and now_s >= self._retry_at_s:
            await self._retry()
        elif now_s >= self._retry_at_s:
            await self._open_ring()
        await self._check_limits()
        if self._ring:
            await self._finish_snapshots(self._ring.due())
            await self._ring.drop_outdated()
        self._measure_rate(now_s)
        if now_s >= self._room_at_s:
            self._room_at_s = now_s + _ROOM_EVERY_S
            await self._keep_room()

    async def _shut_down(self) -> None:
        await self._take_happened()
        if self._ring:
            await self._finish_snapshots(self._ring.due(all_of_them=True), StopReason.SHUTDOWN)
        if self._phase.state is State.RECORDING:
            await self._end(StopReason.SHUTDOWN)
        if self._ring:
            await self._ring.close()
            await self._take_happened()
        self._sources.want(frozenset(), video=False)

    def _pause_s(self) -> float:
        due_s = self._ring.next_due_s if self._ring else None
        return _TICK_S if due_s is None else max(0.0, min(_TICK_S, due_s))

    # --- requests ---

    async def start(self, request_id: str, options: StartOptions) -> Result:
        """Starts a recording; returns when its first file is open.

        Raises:
            InvalidRequestError: no such preset.
            PreconditionError: another one runs, there is no video, or the recorder can't record.
            TooMuchError: the disk has no room.
        """
        async with self._changing:
            if earlier := self._earlier("StartRecording", request_id):
                return earlier
            preset = options.preset or self._settings.first_preset
            with_video = self._with_video(self._known(preset), options.with_video)
            self._check_can_start()
            await self._housekeeping.need_room()
            now_ns = time.time_ns()
            manifest = Manifest(
                id=new_id(now_ns / _NS_PER_S),
                label=options.label,
                notes=options.notes,
                kind=Kind.MANUAL,
                state=RecordingState.STARTING,
                preset=preset,
                with_video=with_video,
                started_unix_ms=now_ns // _NS_PER_MS,
                started_monotonic_ns=time.monotonic_ns(),
                boot_id=self._boot_id,
                run_id=self.run_id,
                max_duration_s=options.max_duration_s,
                max_bytes=options.max_bytes,
            )
            self._move(Event.START)
            await self._open(manifest)
            if self._running is None:
                raise PreconditionError(self._last_error, Reason.RECORDER_NOT_READY)
            return await self._answer(
                "StartRecording", request_id, f"recording {preset}, as {manifest.id}", self._running
            )

    async def stop(self, request_id: str, recording_id: str) -> Result:
        """Stops a recording; returns when it is final, or after 10 s.

        Raises:
            NotFoundError: there is no such, or none runs.
        """
        work = asyncio.ensure_future(self._stop(request_id, recording_id))
        try:
            async with asyncio.timeout(_STOP_WAIT_S):
                return await asyncio.shield(work)
        except TimeoutError:
            work.add_done_callback(_log_failure)
            running = self._running or self.get(recording_id)
            return Result(f"{running.id} is still being finalised", running)

    async def _stop(self, request_id: str, recording_id: str) -> Result:
        async with self._changing:
            if earlier := self._earlier("StopRecording", request_id):
                return earlier
            await self._take_happened()
            if not recording_id and self._running is None:
                raise NotFoundError("no recording runs", Reason.RECORDING_NOT_FOUND)
            manifest = self.get(recording_id) if recording_id else self._running
            assert manifest is not None, "one of both"  # noqa: S101  # for the type checker
            snapshots = self._ring.due(manifest.id) if self._ring else []
            message = f"{manifest.id} had ended already"
            if self._running and self._running.id == manifest.id:
                await self._end(StopReason.REQUESTED)
                message = f"{manifest.id} has ended"
            elif snapshots:
                await self._finish_snapshots(snapshots)
                message = f"{manifest.id} has ended"
            return await self._answer("StopRecording", request_id, message, self.get(manifest.id))

    async def snapshot(self, request_id: str, options: SnapshotOptions, caller: str) -> Result:
        """Keeps what the ring holds, and records what follows; returns at once.

        Raises:
            InvalidRequestError: no such preset, or one that the ring does not record.
            PreconditionError: there is no ring, or it can't be written at present.
            TooMuchError: the disk has no room, or 16 are being made.
        """
        async with self._changing:
            if earlier := self._earlier("TriggerSnapshot", request_id):
                return earlier
            if options.preset:
                self._known(options.preset)
            if self._ring is None:
                raise PreconditionError(
                    "the robot keeps no ring; set ring.preset in the recorder's configuration",
                    Reason.NO_RING,
                )
            await self._take_happened()
            configured = self._settings.snapshot
            made = await self._ring.snapshot(
                Kind.SNAPSHOT,
                configured.pre_s if options.pre_s is None else options.pre_s,
                configured.post_s if options.post_s is None else options.post_s,
                label=options.label,
                preset=options.preset,
                trigger=caller,
            )
            return await self._answer(
                "TriggerSnapshot", request_id, f"snapshot {made.id} is being made", made
            )

    async def pin(self, request_id: str, recording_id: str, *, pinned: bool) -> Result:
        """Pins a recording, or ends that.

        Raises:
            NotFoundError: there is no such.
        """
        async with self._changing:
            if earlier := self._earlier("PinRecording", request_id):
                return earlier
            await self._take_happened()
            manifest = self.get(recording_id).model_copy(update={"pinned": pinned})
            await self._keep(manifest)
            message = f"{recording_id} is pinned" if pinned else f"{recording_id} is no longer pinned"
            return await self._answer("PinRecording", request_id, message, manifest)

    async def delete(
        self, request_id: str, recording_id: str, expected_sha256: bytes, *, force: bool
    ) -> Result:
        """Deletes a recording.

        Raises:
            NotFoundError: there is no such.
            PreconditionError: it is running, pinned, not copied yet, or another one than expected.
        """
        async with self._changing:
            if earlier := self._earlier("DeleteRecording", request_id):
                return earlier
            await self._take_happened()
            manifest = self.get(recording_id)
            _check_deletable(manifest, expected_sha256, force=force)
            await asyncio.to_thread(self._catalogue.delete, manifest)
            _log.info("deleted %s", recording_id)
            return await self._answer("DeleteRecording", request_id, f"{recording_id} is deleted", None)

    async def report_fault(self, fault_id: str, severity: int, message: str) -> str:
        """Makes an incident of a fault, if the rules want one; returns its ID, or ""."""
        async with self._changing:
            if self._ring is None:
                return ""
            await self._take_happened()
            made = await self._ring.report_fault(fault_id, severity, message)
            self._wake.set()
            return made

    async def set_copy(self, recording_id: str, copy: Copy) -> None:
        """Records the state of the copy elsewhere.

        Raises:
            NotFoundError: there is no such recording.
        """
        async with self._changing:
            await self._take_happened()
            await self._keep(self.get(recording_id).model_copy(update={"copied": copy}))

    # --- parts of requests ---

    def _earlier(self, method: str, request_id: str) -> Result | None:
        answer = self._state_file.answered(method, request_id, time.time())
        return Result(answer.message, self._catalogue.get(answer.recording_id)) if answer else None

    async def _answer(self, method: str, request_id: str, message: str, recording: Manifest | None) -> Result:
        answer = Answer(
            method=method,
            recording_id=recording.id if recording else "",
            message=message,
            at_s=time.time(),
        )
        self._state_file.remember(request_id, answer)
        await attempt("the answer is forgotten at the next start", self._state_file.write)
        self.changes.notify_all()
        return Result(message, recording)

    def _known(self, preset: str) -> str:
        if preset not in self._settings.presets:
            known = ", ".join(self._settings.presets)
            raise InvalidRequestError(f"there is no preset '{preset}'; the robot has {known}")
        return preset

    def _with_video(self, preset: str, wanted: bool | None) -> bool:
        if wanted and self._settings.video.socket is None:
            raise PreconditionError(
                "the robot records no video; record without it, or set video.socket in its configuration",
                Reason.NO_VIDEO,
            )
        return self._settings.records_video(preset) if wanted is None else wanted

    def _check_can_start(self) -> None:
        if self._running:
            raise PreconditionError(
                f"recording {self._running.id} runs; stop it first", Reason.RECORDING_RUNS
            )
        if self._phase.state is not State.IDLE:
            why = (
                self._last_error or "recordings that were cut off are being recovered; try again in a moment"
            )
            raise PreconditionError(why, Reason.RECORDER_NOT_READY)

    # --- the running recording ---

    async def _open(self, manifest: Manifest) -> None:
        """Opens the first, or the next, segment of a recording; a failure ends in FAULTED."""
        settings = self._settings.segments
        self._running = manifest
        self._newest = manifest.id
        self._stopped_by_disk = False
        try:
            folder = await asyncio.to_thread(self._catalogue.create, manifest)
            self._output = Output(
                Shape(
                    folder / DATA,
                    lambda number: Path(segment_name(number)).name,
                    manifest.next_number,
                    manifest.preset,
                    manifest.with_video,
                    settings.max_bytes,
                    settings.max_s,
                ),
                self._writer.head,
                self._on_closed,
            )
            self._want()
            await asyncio.wrap_future(self._writer.add(self._output))
        except OSError as error:
            await self._recording_failed(error)
            return
        self._move(Event.OPENED)
        await self._keep(manifest.model_copy(update={"state": RecordingState.RECORDING}))
        _log.info("recording %s (%s)", manifest.id, manifest.preset)

    async def _end(self, reason: StopReason) -> None:
        """Closes the running recording."""
        running, output = self._running, self._output
        if running is None or output is None:
            return
        self._move(Event.STOP)
        await self._sources.caught_up()
        await self._keep(running.model_copy(update={"state": RecordingState.FINALISING}))
        closed = await asyncio.wrap_future(self._writer.remove(output))
        await self._take_happened()
        if not closed or self._running is None:
            return  # The disk has failed; `_recording_failed` has the rest.
        self._output = None
        self._want()
        done = self._at_end(self._running, output.progress)
        folder = self._catalogue.folder_of(done)
        try:
            done = await asyncio.to_thread(ended, folder, done, RecordingState.COMPLETE, reason)
            await self._write(done)
        except OSError as error:
            await self._recording_failed(error)
            return
        self._running = None
        self._move(Event.CLOSED)
        self._backoff.reset()
        self._last_error = ""
        self._remember_rate(done)
        _log.info("%s has ended: %s, %d bytes", done.id, reason, done.size)

    def _at_end(self, manifest: Manifest, progress: Progress) -> Manifest:
        return manifest.model_copy(
            update={
                "ended_unix_ms": time.time_ns() // _NS_PER_MS,
                "ended_monotonic_ns": time.monotonic_ns(),
                "numbered": manifest.numbered and progress.numbered,
            }
        )

    def _remember_rate(self, manifest: Manifest) -> None:
        length_s = (manifest.ended_monotonic_ns - manifest.started_monotonic_ns) / _NS_PER_S
        if length_s >= _MEASURED_S:
            self._state_file.measure(manifest.preset, int(manifest.size * 60 / length_s))

    async def _recording_failed(self, error: OSError) -> None:
        """Ends the running recording after an error of the disk; keeps what had been written."""
        running, output = self._running, self._output
        self._output = None
        self._want()
        full = error.errno in _FULL
        what = "the disk is full" if full else f"the disk can't be written: {error.strerror}"
        self._stopped_by_disk = full
        self._fault(f"{what}; make room or check the disk, it is tried again by itself")
        if running is None:
            return
        now_ns = time.time_ns()
        failed = self._at_end(running, output.progress if output else Progress()).model_copy(
            update={
                "state": RecordingState.FAULTED,
                "stop_reason": StopReason.DISK if full else StopReason.ERROR,
                "gaps": (*running.gaps, Gap("", GapCause.DISK, now_ns, now_ns, None)),
            }
        )
        await asyncio.to_thread(self._reserve.give)
        await self._keep(failed)
        await self._make_whole(failed)
        self._running = None

    async def _make_whole(self, manifest: Manifest) -> None:
        """Closes what an error of the disk has left open; tried again when the disk takes data."""

        def work() -> Manifest:
            folder = self.folder_of(manifest)
            if not folder.is_dir():
                return manifest
            found = whole(folder, manifest)
            return ended(folder, found, found.state, found.stop_reason or StopReason.ERROR)

        done = await attempt(f"{manifest.id} is made whole later", work)
        await self._keep(done or manifest)

    async def _check_limits(self) -> None:
        running, output = self._running, self._output
        if running is None or output is None or self._phase.state is not State.RECORDING:
            return
        length_s = (time.monotonic_ns() - running.started_monotonic_ns) / _NS_PER_S
        size = self._size_of(running)
        late = running.max_duration_s and length_s >= running.max_duration_s
        if late or (running.max_bytes and size >= running.max_bytes):
            await self._end(StopReason.LIMIT)

    def _size_of(self, running: Manifest) -> int:
        return running.size + (self._output.progress.part_bytes if self._output else 0)

    # --- the ring, snapshots ---

    async def _open_ring(self) -> None:
        faulted = self._phase.state in (State.FAULTED, State.RECOVERING)
        if self._ring is None or self._ring.output or faulted:
            return
        try:
            await self._ring.open(self._on_closed)
        except OSError as error:
            self._ring_failed(error)
        self._want()

    def _ring_failed(self, error: OSError) -> None:
        if self._ring:
            self._ring.output = None
        self._want()
        what = f"the ring can't be written: {error.strerror}; it is tried again by itself"
        if self._phase.state is State.IDLE:
            self._fault(what)
        else:
            _log.error("%s", what)
            self._retry_at_s = self._loop.time() + self._backoff.next_s()

    async def _finish_snapshots(
        self, recording_ids: list[str], reason: StopReason = StopReason.REQUESTED
    ) -> None:
        if self._ring and recording_ids:
            await self._sources.caught_up()
            await self._ring.rotate()
            await self._take_happened()
            for each in recording_ids:
                await self._ring.finish(each, reason)

    # --- what the writer's thread reports ---

    def _on_closed(self, output: Output, closed: Closed) -> None:
        self._loop.call_soon_threadsafe(self._note, (output, closed))

    def _on_failed(self, output: Output, error: OSError) -> None:
        self._loop.call_soon_threadsafe(self._note, _Failed(output, error))

    def _note(self, happened: tuple[Output, Closed] | _Failed) -> None:
        self._happened.append(happened)
        self._wake.set()

    async def _take_happened(self) -> None:
        while self._happened:
            match self._happened.popleft():
                case _Failed(output, error) if output is self._output:
                    await self._recording_failed(error)
                case _Failed(output, error) if self._ring and output is self._ring.output:
                    self._ring_failed(error)
                case (output, closed) if output is self._output and self._running:
                    name = segment_name(closed.number)
                    await self._keep(self._running.with_segment(name, closed.summary))
                case (_, closed) if self._ring and closed.path.parent == self._settings.ring_directory:
                    await self._ring.take(closed)

    # --- faults, room, rates ---

    def _fault(self, text: str) -> None:
        _log.error("%s", text)
        self._last_error = text
        self._move(Event.FAILURE)
        self._retry_at_s = self._loop.time() + self._backoff.next_s()

    async def _retry(self) -> None:
        """Tries whether the disk takes data again."""
        if not self._loaded:
            await self._begin()
            return
        try:
            await self._housekeeping.make_room(LEAST_ROOM)
            await asyncio.to_thread(self._reserve.take)
        except OSError as error:
            self._fault(f"the disk can't be written: {error.strerror}; make room or check it")
            return
        for manifest in self.recordings:
            if manifest.state is RecordingState.FAULTED and manifest.metadata is None:
                await self._make_whole(manifest)
        self._move(Event.CLEARED)
        self._last_error = ""
        self._stopped_by_disk = False
        _log.info("the disk takes data again")
        await self._open_ring()

    async def _keep_room(self) -> None:
        await self._housekeeping.measure()
        need = max(LEAST_ROOM, int(self.bytes_per_s * _AHEAD_S))
        if not self.writes or self.room.bytes >= need or await self._housekeeping.make_room(need):
            return
        if self._phase.state is State.RECORDING:
            await self._end(StopReason.DISK)
            self._stopped_by_disk = True
            self._last_error = "recording was stopped: the disk has no room, and nothing on it may be deleted"
            _log.error("%s", self._last_error)

    def _measure_rate(self, now_s: float) -> None:
        written = sum(each.progress.bytes for each in self._outputs)
        since_s, before = self._rate_from
        if written < before or now_s - since_s >= _ROOM_EVERY_S:
            if written >= before and since_s:
                self.bytes_per_s = int((written - before) / (now_s - since_s))
            self._rate_from = (now_s, written)

    # --- small ones ---

    @property
    def _outputs(self) -> list[Output]:
        ring = self._ring.output if self._ring else None
        return [each for each in (self._output, ring) if each]

    def _want(self) -> None:
        """Has the sources take what is recorded at present."""
        shapes = [each.shape for each in self._outputs]
        presets = frozenset(shape.preset for shape in shapes)
        self._sources.want(presets, video=any(shape.with_video for shape in shapes))

    async def _keep(self, manifest: Manifest) -> None:
        """Writes a manifest; where the disk refuses, the memory has it until the next change."""
        if self._running and self._running.id == manifest.id:
            self._running = manifest
        await attempt(
            f"the manifest of {manifest.id} is not on the disk", lambda: self._catalogue.write(manifest)
        )

    async def _write(self, manifest: Manifest) -> None:
        await asyncio.to_thread(self._catalogue.write, manifest)

    def _move(self, event: Event) -> None:
        before = self._phase
        self._phase = step(before, event, self._loop.time())
        if self._phase.state is not before.state:
            _log.info("%s -> %s (%s)", before.state.value, self._phase.state.value, event.value)
        self.changes.notify_all()


def _check_deletable(manifest: Manifest, expected_sha256: bytes, *, force: bool) -> None:
    if manifest.state.open:
        raise PreconditionError(f"{manifest.id} is being written; stop it first", Reason.RECORDING_RUNS)
    if expected_sha256 and expected_sha256 != manifest.sha256:
        raise PreconditionError(
            f"{manifest.id} has changed since it was looked at; look again", Reason.RECORDING_CHANGED
        )
    if manifest.pinned and not force:
        raise PreconditionError(
            f"{manifest.id} is pinned; unpin it, or delete it with force as an administrator",
            Reason.RECORDING_PINNED,
        )
    if manifest.copied.outstanding and not force:
        raise PreconditionError(
            f"{manifest.id} still has to be copied; wait, or delete it with force as an administrator",
            Reason.RECORDING_NOT_COPIED,
        )


def _log_failure(task: "asyncio.Task[Result]") -> None:
    if not task.cancelled() and (error := task.exception()):
        _log.error("a recording could not be stopped: %s", error)
