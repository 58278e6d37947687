"""Records what was requested: one recording at a time, from its first file to its manifest."""

import asyncio
import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from recorder.config import RecorderSettings
from recorder.recording.lifecycle import Event, State
from recorder.recording.lifecycle_runner import LifecycleRunner
from recorder.recording.outputs import Outputs, Sources
from recorder.recording.requests import Live
from recorder.store.catalogue import Catalogue, first_free_number
from recorder.store.folder import DATA, segment_name
from recorder.store.housekeeping import attempt
from recorder.store.manifest import Manifest, RecordingState, StopReason
from recorder.store.room import Reserve, is_full
from recorder.store.salvage import ended, whole
from recorder.store.state_file import StateFile
from recorder.values import Gap, GapCause
from recorder.writing.output import Closed, Output, Progress, Shape
from recorder.writing.writer import Writer

_log = logging.getLogger(__name__)

_MEASURED_S: Final = 10.0
"""A shorter recording says little about what its preset takes."""
_MOST_VIDEO_MISSING: Final = 0.1
"""A recording that lacks its video for a larger share of its length would make the preset seem small."""
_NS_PER_S: Final = 1_000_000_000
_NS_PER_MS: Final = 1_000_000


class ManualRecorder:
    """The running recording of a recorder, which calls it under its lock.

    Args:
        settings: of the program.
        lifecycle: which it moves from STARTING to IDLE, or to FAULTED.
        catalogue: has the recordings.
        outputs: has the recording's while it is written.
        writer: writes it.
        sources: of the messages.
        state_file: keeps what a preset takes.
        reserve: is given back when the disk is full.
        boot_id: of the computer; empty if unknown.

    Attributes:
        running: the recording that runs.
        newest_id: of the recording that runs or has ended last; empty before the first.
    """

    def __init__(
        self,
        settings: RecorderSettings,
        lifecycle: LifecycleRunner,
        catalogue: Catalogue,
        outputs: Outputs,
        writer: Writer,
        *,
        sources: Sources,
        state_file: StateFile,
        reserve: Reserve,
        boot_id: str,
    ) -> None:
        self._settings = settings
        self._lifecycle = lifecycle
        self._catalogue = catalogue
        self._state_file = state_file
        self._reserve = reserve
        self._outputs = outputs
        self._sources = sources
        self._writer = writer
        self._boot_id = boot_id
        self.running: Manifest | None = None
        self.newest_id = ""

    async def open(
        self,
        manifest: Manifest,
        closed: Callable[[Output, Closed], None],
        *,
        after: Gap | None = None,
    ) -> None:
        """Opens the first, or the next, segment of a recording; a failure ends in FAULTED.

        Args:
            manifest: of the recording.
            closed: called, by the writer's thread, with each segment that has become final.
            after: the manifest's gap for the interruption before it, which its next file has as well; None if
                there was none.
        """
        self.running = manifest
        self.newest_id = manifest.id
        self._lifecycle.stopped_by_disk = False
        try:
            shape = await asyncio.to_thread(self._prepared, manifest)
            output = Output(shape, self._writer.head, closed, after=after)
            await asyncio.wrap_future(self._writer.add(output))
        except OSError as error:
            await self.fail(error)
            return
        self._outputs.recording = output
        self._lifecycle.move(Event.OPENED)
        await self.keep(manifest.model_copy(update={"state": RecordingState.RECORDING}))
        _log.info("recording %s (%s)", manifest.id, manifest.preset)

    async def take(self, closed: Closed) -> None:
        """Takes a segment that has become final."""
        if self.running:
            await self.keep(self.running.with_segment(segment_name(closed.number), closed.summary))

    async def close(self) -> bool:
        """Closes the last segment; returns whether `complete` is to follow, once `take` has it."""
        output = self._outputs.recording
        if self.running is None or output is None:
            return False
        self._lifecycle.move(Event.STOP)
        await self._sources.caught_up()
        await self.keep(self.running.model_copy(update={"state": RecordingState.FINALISING}))
        return await asyncio.wrap_future(self._writer.remove(output))

    async def complete(self, reason: StopReason) -> None:
        """Ends the recording whose last segment is final."""
        running, output = self.running, self._outputs.recording
        if running is None or output is None:
            return  # The disk has failed; `fail` has the rest.
        self._outputs.recording = None
        done = _at_end(running, output.progress)
        folder = self._catalogue.folder_of(done)
        try:
            done = await asyncio.to_thread(ended, folder, done, RecordingState.COMPLETE, reason)
            await asyncio.to_thread(self._catalogue.write, done)
        except OSError as error:
            await self.fail(error)
            return
        self.running = None
        self._lifecycle.close_well()
        await self._remember_rate(done)
        _log.info("%s has ended: %s, %d bytes", done.id, reason, done.size)

    async def fail(self, error: OSError) -> None:
        """Ends the running recording after an error of the disk; keeps what had been written."""
        running, output = self.running, self._outputs.recording
        self._outputs.recording = None
        full = is_full(error)
        what = "the disk is full" if full else f"the disk can't be written: {error.strerror}"
        self._lifecycle.stopped_by_disk = full
        self._lifecycle.fault(f"{what}; make room or check the disk, it is tried again by itself")
        if running is None:
            return
        now_ns = time.time_ns()
        progress = output.progress if output else Progress(last_ns=now_ns)
        # What came after the newest flush was lost with the buffers.
        lost = Gap("", GapCause.DISK, min(progress.last_ns, now_ns), now_ns, None)
        failed = _at_end(running, progress).model_copy(
            update={
                "state": RecordingState.FAULTED,
                "stop_reason": StopReason.DISK if full else StopReason.ERROR,
                "gaps": (*running.gaps, lost),
            }
        )
        await asyncio.to_thread(self._reserve.give)
        await self.keep(failed)
        await self.make_whole(failed)
        self.running = None

    async def make_whole(self, manifest: Manifest) -> None:
        """Closes what an error of the disk has left open; tried again when the disk takes data."""

        def work() -> Manifest:
            folder = self._catalogue.folder_of(manifest)
            if not folder.is_dir():
                return manifest
            found = whole(folder, manifest)
            return ended(folder, found, found.state, found.stop_reason or StopReason.ERROR)

        done = await attempt(f"{manifest.id} is made whole later", work)
        await self.keep(done or manifest)

    async def keep(self, manifest: Manifest) -> None:
        """Writes a manifest; where the disk refuses, the memory has it, and it is tried again."""
        if self.running and self.running.id == manifest.id:
            self.running = manifest
        await attempt(
            f"the manifest of {manifest.id} is not on the disk", lambda: self._catalogue.write(manifest)
        )

    @property
    def at_its_limit(self) -> bool:
        """Whether the recording has become as long or as large as was requested."""
        running, output = self.running, self._outputs.recording
        if running is None or output is None or self._lifecycle.state is not State.RECORDING:
            return False
        length_s = (time.monotonic_ns() - running.started_monotonic_ns) / _NS_PER_S
        size = running.size + output.progress.part_bytes
        late = running.max_duration_s and length_s >= running.max_duration_s
        return bool(late or (running.max_bytes and size >= running.max_bytes))

    def live(self, manifest: Manifest) -> Live:
        """Returns how far a recording has come, including what of it is not final yet."""
        duration_ms = self._duration_ms(manifest)
        output = self._outputs.recording if self.running and self.running.id == manifest.id else None
        if output is None:
            return Live(duration_ms, manifest.messages, manifest.video_frames, manifest.losses)
        before = manifest.before(output.shape.first)
        progress = output.progress
        return Live(
            duration_ms,
            before.messages + progress.messages,
            before.video_frames + progress.frames,
            before.losses + progress.losses,
            segment_name(int(progress.part.stem)) if progress.part else "",
            progress.part_bytes,
        )

    def _duration_ms(self, manifest: Manifest) -> int:
        ended_ns = manifest.ended_monotonic_ns
        if manifest.state.open and manifest.boot_id == self._boot_id:
            ended_ns = ended_ns or time.monotonic_ns()
        length_ms = (ended_ns - manifest.started_monotonic_ns) // _NS_PER_MS if ended_ns else 0
        calendar_ms = manifest.ended_unix_ms - manifest.started_unix_ms
        return max(length_ms or calendar_ms, 0)

    def _prepared(self, manifest: Manifest) -> Shape:
        """Makes the folder of a recording, and returns the shape of its next segments; in a thread."""
        folder = self._catalogue.create(manifest)
        settings = self._settings.segments
        return Shape(
            folder / DATA,
            lambda number: Path(segment_name(number)).name,
            first_free_number(folder),
            manifest.preset,
            manifest.with_video,
            settings.max_bytes,
            settings.max_s,
        )

    async def _remember_rate(self, manifest: Manifest) -> None:
        """Keeps what the preset takes, on the disk as well: a recording may end without any request."""
        length_s = (manifest.ended_monotonic_ns - manifest.started_monotonic_ns) / _NS_PER_S
        if length_s < _MEASURED_S:
            return
        # Without its frames it would pass for a small one of those that have them.
        with_video = manifest.video_frames > 0
        if with_video and _without_video_s(manifest) > _MOST_VIDEO_MISSING * length_s:
            return
        rate = int(manifest.size * 60 / length_s)
        self._state_file.measure(manifest.preset, rate, with_video=with_video)
        await attempt("what the preset takes is forgotten at the next start", self._state_file.write)


def _without_video_s(manifest: Manifest) -> float:
    """Returns for how long frames are missing."""
    gaps = (each for each in manifest.all_gaps if each.cause is GapCause.VIDEO)
    return sum(each.ended_ns - each.began_ns for each in gaps) / _NS_PER_S


def _at_end(manifest: Manifest, progress: Progress) -> Manifest:
    return manifest.model_copy(
        update={
            "ended_unix_ms": time.time_ns() // _NS_PER_MS,
            "ended_monotonic_ns": time.monotonic_ns(),
            "numbered": manifest.numbered and progress.losses.numbered,
        }
    )
