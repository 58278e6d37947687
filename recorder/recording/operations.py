"""What callers request: each operation under the recorder's lock, and answered once for each request ID."""

import asyncio
import logging
import time
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, Final, ParamSpec, TypeVar

from common.errors import (
    InvalidRequestError,
    NotFoundError,
    PreconditionError,
    RecorderUnreachableError,
    TooMuchError,
)
from common.reasons import Reason
from recorder.recording.assembly import Parts
from recorder.recording.lifecycle import Event, State
from recorder.recording.recorder import Recorder
from recorder.recording.requests import Result, SnapshotOptions, StartOptions
from recorder.recording.status_reader import StatusReader
from recorder.store.folder import new_id
from recorder.store.housekeeping import attempt
from recorder.store.manifest import Copy, Kind, Manifest, RecordingState, StopReason
from recorder.store.state_file import Answer

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine

_log = logging.getLogger(__name__)
_P = ParamSpec("_P")
_T = TypeVar("_T")

_STOP_WAIT_S: Final = 10.0
_NS_PER_S: Final = 1_000_000_000
_NS_PER_MS: Final = 1_000_000


def _changing(
    operation: "Callable[Concatenate[Operations, _P], Coroutine[Any, Any, _T]]",
) -> "Callable[Concatenate[Operations, _P], Coroutine[Any, Any, _T]]":
    """Decorates an operation: it holds the recorder's lock, and goes on to its end when its caller has left.

    Callers leave at any time: a deadline passes while a slow disk opens a file. Half an operation would stay.
    """

    @wraps(operation)
    async def changing(self: "Operations", /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        lock = self._recorder.changing
        await lock.acquire()
        if self._recorder.ending:
            lock.release()
            raise RecorderUnreachableError("the recorder is being ended; try again when it is back")
        work = asyncio.create_task(operation(self, *args, **kwargs))
        work.add_done_callback(lambda _: lock.release())
        try:
            return await asyncio.shield(work)
        except asyncio.CancelledError:
            work.add_done_callback(_log_failure)
            raise

    return changing


class Operations:
    """The operations of a recorder that runs; used on its event loop.

    Args:
        parts: of the recorder.
        status_reader: of the same.
        recorder: runs them.
    """

    def __init__(self, parts: Parts, status_reader: StatusReader, recorder: Recorder) -> None:
        self._parts = parts
        self._settings = parts.settings
        self._lifecycle = parts.lifecycle
        self._manual = parts.manual
        self._ring = parts.ring
        self._status_reader = status_reader
        self._recorder = recorder

    @_changing
    async def start(self, request_id: str, options: StartOptions) -> Result:
        """Starts a recording; returns when its first file is open.

        Raises:
            InvalidRequestError: no such preset.
            PreconditionError: another one runs, there is no video, or the recorder can't record.
            TooMuchError: the disk has no room.
        """
        if earlier := self._earlier("StartRecording", request_id):
            return earlier
        preset = options.preset or self._settings.first_preset
        with_video = self._with_video(self._known(preset), options.with_video)
        self._check_can_start()
        await self._parts.housekeeping.need_room()
        self._lifecycle.move(Event.START)
        await self._manual.open(self._begun(preset, with_video, options), self._parts.reports.closed)
        if self._manual.running is None:
            raise PreconditionError(self._lifecycle.error, Reason.RECORDER_NOT_READY)
        made = self._manual.running
        return await self._answer("StartRecording", request_id, f"recording {preset}, as {made.id}", made)

    async def stop(self, request_id: str, recording_id: str) -> Result:
        """Stops a recording; returns when it is final, or after 10 s.

        Raises:
            NotFoundError: there is no such, or none runs.
        """
        running = self._manual.running
        asked = recording_id or (running.id if running else "")
        work = asyncio.ensure_future(self._stop(request_id, recording_id))
        try:
            async with asyncio.timeout(_STOP_WAIT_S):
                return await asyncio.shield(work)
        except TimeoutError:
            work.add_done_callback(_log_failure)
            if not asked:
                raise NotFoundError("no recording runs", Reason.RECORDING_NOT_FOUND) from None
            return Result(f"{asked} is still being finalised", self._status_reader.get(asked))

    @_changing
    async def _stop(self, request_id: str, recording_id: str) -> Result:
        if earlier := self._earlier("StopRecording", request_id):
            return earlier
        await self._recorder.take_reports()
        running = self._manual.running
        if not recording_id and running is None:
            raise NotFoundError("no recording runs", Reason.RECORDING_NOT_FOUND)
        manifest = self._status_reader.get(recording_id) if recording_id else running
        assert manifest is not None, "one of both"  # noqa: S101  # for the type checker
        snapshots = self._ring.snapshots.due(manifest.id) if self._ring else []
        message = f"{manifest.id} had ended already"
        if running and running.id == manifest.id:
            await self._recorder.end(StopReason.REQUESTED)
            message = f"{manifest.id} has ended"
        elif snapshots:
            await self._recorder.finish_snapshots(snapshots)
            message = f"{manifest.id} has ended"
        return await self._answer("StopRecording", request_id, message, self._status_reader.get(manifest.id))

    @_changing
    async def snapshot(self, request_id: str, options: SnapshotOptions, caller: str) -> Result:
        """Keeps what the ring holds, and records what follows; returns at once.

        Raises:
            InvalidRequestError: no such preset, or one that the ring does not record.
            PreconditionError: there is no ring, or it can't be written at present.
            TooMuchError: the disk has no room, or 16 are being made.
        """
        if earlier := self._earlier("TriggerSnapshot", request_id):
            return earlier
        if options.preset:
            self._known(options.preset)
        if self._ring is None:
            raise PreconditionError(
                "the robot keeps no ring; set ring.preset in the recorder's configuration",
                Reason.NO_RING,
            )
        await self._recorder.take_reports()
        configured = self._settings.snapshot
        made = await self._ring.snapshots.make(
            Kind.SNAPSHOT,
            configured.pre_s if options.pre_s is None else options.pre_s,
            configured.post_s if options.post_s is None else options.post_s,
            label=options.label,
            preset=options.preset,
            trigger=caller,
        )
        return await self._answer("TriggerSnapshot", request_id, f"snapshot {made.id} is being made", made)

    @_changing
    async def pin(self, request_id: str, recording_id: str, *, pinned: bool) -> Result:
        """Pins a recording, or ends that.

        Raises:
            NotFoundError: there is no such.
            PreconditionError: the disk refuses to read it.
            TooMuchError: the disk refuses to keep that; it is tried again, and holds until a restart.
        """
        if earlier := self._earlier("PinRecording", request_id):
            return earlier
        await self._recorder.take_reports()
        manifest = self._status_reader.get(recording_id).model_copy(update={"pinned": pinned})
        if recording_id in self._parts.catalogue.unread:
            raise PreconditionError(self._parts.catalogue.problems[recording_id], Reason.RECORDER_NOT_READY)
        await self._manual.keep(manifest)
        message = f"{recording_id} is pinned" if pinned else f"{recording_id} is no longer pinned"
        if recording_id in self._parts.catalogue.unwritten:
            raise TooMuchError(
                f"{message}, but the disk refuses to keep that over a restart; it is tried again: make room, "
                "or check the disk",
                Reason.DISK_FULL,
            )
        return await self._answer("PinRecording", request_id, message, manifest)

    @_changing
    async def delete(
        self, request_id: str, recording_id: str, expected_sha256: bytes, *, force: bool
    ) -> Result:
        """Deletes a recording.

        Raises:
            NotFoundError: there is no such.
            PreconditionError: it is running, pinned, not copied yet, or another one than expected.
        """
        if earlier := self._earlier("DeleteRecording", request_id):
            return earlier
        await self._recorder.take_reports()
        manifest = self._status_reader.get(recording_id)
        _check_deletable(manifest, expected_sha256, force=force)
        message = f"{recording_id} is deleted"
        try:
            await asyncio.to_thread(self._parts.catalogue.delete, manifest)
        except OSError as error:
            if self._parts.catalogue.get(recording_id):
                raise TooMuchError(
                    f"the disk refuses to delete {recording_id}: {error.strerror}; check the disk",
                    Reason.DISK_FULL,
                ) from error
            message = f"{message}; the disk still has files of it, and they are deleted later"
        _log.info("%s", message)
        return await self._answer("DeleteRecording", request_id, message, None)

    @_changing
    async def report_fault(self, fault_id: str, severity: int, message: str) -> str:
        """Makes an incident of a fault, if the rules want one; returns its ID, or "".

        Raises:
            PreconditionError: the ring can't be written at present.
            TooMuchError: the disk has no room, or 16 snapshots are being made.
        """
        if self._ring is None:
            return ""
        await self._recorder.take_reports()
        made = await self._ring.snapshots.report_fault(fault_id, severity, message)
        self._parts.reports.wake.set()
        return made

    @_changing
    async def set_copy(self, recording_id: str, copy: Copy) -> None:
        """Records the state of the copy elsewhere.

        Raises:
            NotFoundError: there is no such recording.
        """
        await self._recorder.take_reports()
        await self._manual.keep(self._status_reader.get(recording_id).model_copy(update={"copied": copy}))

    # --- parts of operations ---

    def _earlier(self, method: str, request_id: str) -> Result | None:
        answer = self._parts.state_file.answered(method, request_id, time.monotonic())
        return Result(answer.message, self._parts.catalogue.get(answer.recording_id)) if answer else None

    async def _answer(self, method: str, request_id: str, message: str, recording: Manifest | None) -> Result:
        answer = Answer(
            method=method,
            recording_id=recording.id if recording else "",
            message=message,
            at_s=time.monotonic(),
            boot_id=self._parts.boot_id,
        )
        state_file = self._parts.state_file
        state_file.remember(request_id, answer)
        await attempt("the answer is forgotten at the next start", state_file.write)
        self._lifecycle.changes.notify_all()
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
        if running := self._manual.running:
            raise PreconditionError(f"recording {running.id} runs; stop it first", Reason.RECORDING_RUNS)
        if self._lifecycle.state is not State.IDLE:
            why = (
                self._lifecycle.error
                or "recordings that were cut off are being recovered; try again in a moment"
            )
            raise PreconditionError(why, Reason.RECORDER_NOT_READY)

    def _begun(self, preset: str, with_video: bool, options: StartOptions) -> Manifest:
        now_ns = time.time_ns()
        return Manifest(
            id=new_id(now_ns / _NS_PER_S),
            ordinal=self._parts.catalogue.next_ordinal,
            label=options.label,
            notes=options.notes,
            kind=Kind.MANUAL,
            state=RecordingState.STARTING,
            preset=preset,
            with_video=with_video,
            started_unix_ms=now_ns // _NS_PER_MS,
            started_monotonic_ns=time.monotonic_ns(),
            boot_id=self._parts.boot_id,
            run_id=self._parts.run_id,
            max_duration_s=options.max_duration_s,
            max_bytes=options.max_bytes,
        )


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


def _log_failure(task: "asyncio.Task[Any]") -> None:
    if not task.cancelled() and (error := task.exception()):
        _log.error("an operation whose caller has left has failed: %s", error)
