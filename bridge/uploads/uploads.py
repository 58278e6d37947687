"""Uploads recordings: one at a time, while the gates are open, for ever.

| what happens | what follows |
|---|---|
| a gate closes | the attempt ends within a second: PAUSED; later it goes on at the first missing part |
| a more urgent recording is queued | it takes the place of the one that is uploaded |
| an attempt fails because of this recording | FAILED; again after 1, 2, 4 ... 300 s; others go on |
| gateway, hub or store fail | FAILED; all wait 1, 2, 4 ... 300 s with jitter, from 1 s again after progress |
| the hours begin | it begins within 30 s: other robots' hours begin with them |
| they fail three times at one recording, without progress | as a failure of that one: others go on |
| the recording is deleted on the robot | it leaves the queue |
| the queue is full | a more urgent recording takes the last one's place, which competes for one again |
| that is a run bundle, requested by hand | it keeps its place, as nothing else knows of the request |
| the bridge's disk fails | the queue goes on in memory; `disk_error` says why; a new request is refused |
| the queue on the disk is lost | what the recorder expects to be copied is queued again |
"""

import asyncio
import logging
import random
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final

from bridge.jittered_backoff import JitteredBackoff
from bridge.uploads import gates
from bridge.uploads.attempt import Attempt, Parties, RecordingSource, ended
from bridge.uploads.config import UploadSettings
from bridge.uploads.gates import Conditions
from bridge.uploads.left_out import LeftOut
from bridge.uploads.parts import PartSender
from bridge.uploads.problems import AttemptError, CutError, GoneError
from bridge.uploads.queue import (
    FIRST_PAUSE_S,
    LONGEST_PAUSE_S,
    MOST_KEPT,
    MOST_WAITING,
    TRANSITIONS,
    WAITING,
    Event,
    Priority,
    State,
    Upload,
    UploadStore,
    in_order,
    last_to_run,
    next_upload,
    progressed,
    step,
)
from bridge.uploads.receivers import Receivers, Requests
from bridge.uploads.route import interface_to
from bridge.uploads.unconfirmed import Unconfirmed
from common.backoff import Backoff
from common.errors import NotFoundError, PreconditionError, TooMuchError
from common.reasons import Reason
from console.client import results
from console.client.errors import Refused

_log = logging.getLogger(__name__)

_TICK_S: Final = 1.0
"""How often the gates are looked at."""
OPENING_SPREAD_S: Final = 30.0
"""After the gates have opened where hours are set: those of a whole fleet may begin in the same second."""
_MOST_UNCONFIRMED: Final = 256
"""Uploads that are remembered beyond the others until the recorder knows them; run bundles it never does."""
_RATE_TICKS: Final = 5
"""Over how many the rate is measured."""

_STATES: Final = {
    State.LOCAL: results.RecordingCopyState.UNKNOWN,
    State.QUEUED: results.RecordingCopyState.QUEUED,
    State.UPLOADING: results.RecordingCopyState.UPLOADING,
    State.VERIFYING: results.RecordingCopyState.VERIFYING,
    State.VERIFIED: results.RecordingCopyState.VERIFIED,
    State.PAUSED: results.RecordingCopyState.PAUSED,
    State.FAILED: results.RecordingCopyState.FAILED,
}
"""As the recorder keeps them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fleet:
    """As whom the robot uploads, from its enrolment.

    Attributes:
        fleet, robot: The names under which the robot is enrolled.
        keys: Public ones of the fleet's receivers (fleet/receipt_keys.py).
    """

    fleet: str
    robot: str
    keys: tuple[bytes, ...]


class Uploads:
    """The queue of uploads and what works on it. Used on one event loop.

    Args:
        settings: When, and where to.
        fleet: As whom.
        store: Keeps the queue.
        source: The robot's gateway, with the role of a viewer.
        hub: The connection to the hub.
        charging: Returns whether the main battery is being charged; None if unknown.
        changed: Called after each change that is worth a report.
        most_kept: Uploads that wait no more and are remembered; the store may have room for fewer.
    """

    def __init__(
        self,
        settings: UploadSettings,
        fleet: Fleet,
        *,
        store: UploadStore,
        source: RecordingSource,
        hub: Requests,
        charging: Callable[[], bool | None],
        changed: Callable[[], None],
        most_kept: int = MOST_KEPT,
    ) -> None:
        self._settings, self._fleet = settings, fleet
        self._store, self._source, self._hub = store, source, hub
        self._charging, self._changed, self._most_kept = charging, changed, most_kept
        self._uploads: dict[str, Upload] = {}
        self._wake = asyncio.Event()
        # A receiver that fails, or is busy, is so for a whole fleet at once.
        self._path = JitteredBackoff(LONGEST_PAUSE_S)
        self._path_due_s = 0.0
        self._load_pause = Backoff(FIRST_PAUSE_S, LONGEST_PAUSE_S)
        self._load_due_s = 0.0
        self._running: tuple[str, asyncio.Task[None]] | None = None
        self._ending = set[asyncio.Task[None]]()
        """Attempts that were cancelled and still close their connections."""
        self._disk = asyncio.Lock()
        self._sender: PartSender | None = None
        self._sent = deque[tuple[float, int]](maxlen=_RATE_TICKS)
        self.unconfirmed = Unconfirmed()
        """Those that the recorder may not have as they are."""
        self._left_out = LeftOut()
        self.loaded = asyncio.Event()
        """Set once the queue has been read from the disk, or that has failed."""
        self.paused = ""
        """Why nothing is uploaded although something waits, for people. Otherwise empty."""
        self.disk_error = ""
        """Why the queue can't be kept on the disk; empty when all is well."""
        self.cuts = 0
        """Attempts that ended because the gateway, the hub or the store failed, since the start."""

    @property
    def waiting(self) -> list[Upload]:
        """The uploads that run or wait, the one that runs first."""
        return in_order(self._uploads.values())

    @property
    def settled(self) -> list[Upload]:
        """Those that are verified, or were taken from the queue; the newest first."""
        return [each for each in reversed(self._uploads.values()) if each.state not in WAITING]

    def get(self, recording_id: str) -> Upload | None:
        """Returns the upload of a recording, in whatever state; None if there is none."""
        return self._uploads.get(recording_id)

    @property
    def current(self) -> Upload | None:
        """The one that is being uploaded or verified."""
        return self._uploads.get(self._running[0]) if self._running else None

    @property
    def left_out(self) -> int:
        """Recordings that are to be copied and find no place in the queue, as the last list has them."""
        return self._left_out.count

    @property
    def bytes_per_s(self) -> int:
        """Bytes a second that are sent at present."""
        if len(self._sent) < 2:
            return 0
        (first_s, first), (last_s, last) = self._sent[0], self._sent[-1]
        return round((last - first) / (last_s - first_s)) if last_s > first_s else 0

    @property
    def sent_bytes(self) -> int:
        """Bytes of parts sent since the start, those that were sent twice included."""
        return self._sender.sent_bytes if self._sender else 0

    async def enqueue(self, recording_id: str) -> Upload:
        """Puts a recording into the queue on request, or has a failed one tried again at once.

        Raises:
            GatewayError: The gateway does not answer.
            NotFoundError: There is no such recording.
            PreconditionError: It has not ended.
            TooMuchError: The queue, or the bridge's disk, is full.
        """
        await self.loaded.wait()
        recording = await self._look_up(recording_id)
        if not ended(recording):
            raise PreconditionError(f"{recording_id} has not ended", Reason.RECORDING_RUNS)
        upload = self._uploads.get(recording_id) or _new(recording, Priority.BY_HAND)
        if upload.state is State.VERIFIED and _differs(upload, recording):
            upload = step(upload, Event.CHANGED, self._now_s)
        else:
            upload = step(upload, Event.ENQUEUE, self._now_s)
        upload = replace(upload, priority=min(upload.priority, Priority.BY_HAND))
        if upload.state in WAITING and not self._has_room_for(upload):
            raise TooMuchError(f"{MOST_WAITING} recordings wait to be uploaded", Reason.TOO_MANY_REQUESTS)
        is_new = recording_id not in self._uploads
        self._put(upload)
        try:
            await self._write(recording_id)
        except OSError as error:
            if is_new:
                self._drop(recording_id)
            raise TooMuchError(f"the bridge's disk can't be written: {error}", Reason.DISK_FULL) from error
        await self._displace()
        # An operator who asks again does not wait for the end of a pause.
        self._path_due_s = 0.0
        self._wake.set()
        return self._uploads.get(recording_id, upload)

    async def cancel(self, recording_id: str) -> Upload:
        """Takes a recording from the queue; a copy that is verified stays. No rule puts it back.

        Returns:
            The upload as it was.

        Raises:
            GatewayError: It is not in the queue, and the gateway does not answer whether it is to be.
            NotFoundError: It is not in the queue.
        """
        await self.loaded.wait()
        upload = self._uploads.get(recording_id) or await self._without_place(recording_id)
        if upload is None or upload.state is State.LOCAL:
            raise NotFoundError(f"{recording_id} is not in the queue of uploads", Reason.RECORDING_NOT_FOUND)
        if upload.state is not State.VERIFIED:
            self._end_attempt(recording_id)
            await self._apply(recording_id, Event.REMOVE)
            self._wake.set()
        return upload

    def begin_listing(self) -> None:
        """Takes that the recorder's list is read from its beginning: each page of it goes to `consider`."""
        self.unconfirmed.begin_listing()
        self._left_out.begin_listing()

    async def consider(self, recordings: Iterable[results.Recording]) -> None:
        """Takes recordings of the recorder's list, and queues those that have ended and are to be copied.

        Those are what the rule selects, and what the recorder expects to be copied although it is not in the
        queue: that was lost with the bridge's disk, or has lost its place. The list begins with the newest:
        once the queue is full, those that go before others take the places of the last ones.
        """
        await self.loaded.wait()
        wanted = []
        for recording in recordings:
            known = self._uploads.get(recording.id)
            if known:
                self.unconfirmed.listed(recording.id, confirmed=_is_known(known, recording.copy))
            if not ended(recording):
                continue
            selected = _selects(self._settings.rule, recording)
            if known is None and _is_wanted(recording, selected=selected):
                lowest = Priority.OTHER if selected else Priority.BY_HAND
                wanted.append(step(_new(recording, lowest), Event.ENQUEUE, self._now_s))
            elif known and selected and known.state is State.VERIFIED and _differs(known, recording):
                wanted.append(step(known, Event.CHANGED, self._now_s))
        for upload in sorted(wanted, key=lambda each: each.order):
            await self._admit(upload)
        self._wake.set()

    def end_listing(self) -> None:
        """Takes that the recorder's list was read to its end."""
        self.unconfirmed.end_listing()
        if self._left_out.end_listing():
            if count := self.left_out:
                _log.warning(
                    "%d recordings are to be copied and find no place: %d wait already", count, MOST_WAITING
                )
            else:
                _log.info("all recordings that are to be copied have a place in the queue again")
            self._changed()

    async def run(self, stop: asyncio.Event) -> None:
        """Uploads until `stop`; what is being sent then goes on where it was, after the next start.

        Raises:
            UserError: The store's certificate authority can't be read.
        """
        waiter = asyncio.ensure_future(stop.wait())
        waiter.add_done_callback(lambda _: self._wake.set())
        try:
            async with PartSender(self._settings) as sender:
                self._sender = sender
                while not stop.is_set():
                    if self._now_s >= self._load_due_s:
                        await self._load()
                    await self._tick()
                    await self._next_tick()
        finally:
            waiter.cancel()
            if self._running:
                self._end_attempt(self._running[0])
            await asyncio.gather(*self._ending, return_exceptions=True)

    async def _load(self) -> None:
        """Reads the queue from the disk, once; where that fails, again later.

        What has happened to a recording meanwhile counts.
        """
        try:
            rows = await self._store.uploads()
        except OSError as error:
            self._note_disk(error)
            self._load_due_s = self._now_s + self._load_pause.next_s()
        else:
            for upload in rows:
                self._uploads.setdefault(upload.recording_id, step(upload, Event.RESTART, self._now_s))
            for upload in reversed(self.waiting):
                self.unconfirmed.changed(upload.recording_id)
            self.disk_error = ""
            self._load_due_s = float("inf")
            # Fewer than before may be remembered, where the outbox was made smaller, or counts as such now.
            await self._trim()
        self.loaded.set()

    async def _next_tick(self) -> None:
        try:
            async with asyncio.timeout(_TICK_S):
                await self._wake.wait()
        except TimeoutError:
            pass
        self._wake.clear()

    async def _tick(self) -> None:
        """Ends and begins attempts, as the gates and the queue have it."""
        self._sent.append((self._now_s, self.sent_bytes))
        if self._running and self._running[1].done():
            await self._finish(*self._running)
        closed = await self._closed() if self.waiting else ""
        if closed != self.paused:
            if not closed and self._settings.hours:
                opens_s = self._now_s + random.uniform(0.0, OPENING_SPREAD_S)  # noqa: S311  # no secret
                self._path_due_s = max(self._path_due_s, opens_s)
            self.paused = closed
            self._changed()
        if not closed:
            for each in self.waiting:
                if each.state is State.PAUSED:
                    await self._apply(each.recording_id, Event.RESUME)
        path_works = not self._path.failures
        head = next_upload(self._uploads.values(), self._now_s, path_works=path_works)
        if closed:
            await self._pause(head, closed)
        elif head:
            await self._advance(head)

    async def _pause(self, head: Upload | None, closed: str) -> None:
        current = self.current
        # A receiver reads without this robot's network.
        if current and current.state is State.UPLOADING:
            self._end_attempt(current.recording_id)
            await self._apply(current.recording_id, Event.PAUSE, closed)
        elif head and not current and head.reason != closed:
            if head.state is State.FAILED:
                await self._apply(head.recording_id, Event.RESUME)
            await self._apply(head.recording_id, Event.PAUSE, closed)

    async def _advance(self, head: Upload) -> None:
        current = self.current
        if current and head.priority < current.priority and current.state is State.UPLOADING:
            self._end_attempt(current.recording_id)
            await self._apply(current.recording_id, Event.GIVE_WAY)
        if not self._running and self._now_s >= self._path_due_s:
            if head.state is not State.QUEUED:
                await self._apply(head.recording_id, Event.RESUME)
            await self._apply(head.recording_id, Event.BEGIN)
            begun = self._uploads.get(head.recording_id)
            if begun and begun.state is State.UPLOADING:
                self._begin(head.recording_id)

    def _begin(self, recording_id: str) -> None:
        assert self._sender, "an attempt begins while it runs"  # noqa: S101  # run() has set it
        parties = Parties(
            fleet=self._fleet.fleet,
            robot=self._fleet.robot,
            source=self._source,
            receivers=Receivers(self._hub, self._fleet.robot),
            sender=self._sender,
            keys=self._fleet.keys,
        )

        def begun(size: int, sha256: bytes) -> None:
            self._put(replace(self._uploads[recording_id], size=size, sha256=sha256))

        def progress(done: int) -> None:
            upload = self._uploads[recording_id]
            if done > upload.bytes_done:
                self._path.reset()
            self._put(progressed(upload, done))

        def sent() -> None:
            self._put(step(self._uploads[recording_id], Event.SENT, self._now_s))

        attempt = Attempt(parties, recording_id, begun=begun, progress=progress, sent=sent)
        task = asyncio.create_task(attempt.run(), name=f"upload {recording_id}")
        task.add_done_callback(lambda _: self._wake.set())
        self._running = recording_id, task

    async def _finish(self, recording_id: str, task: asyncio.Task[None]) -> None:
        """Takes the outcome of an attempt that has ended by itself."""
        self._running = None
        try:
            await task
        except GoneError:
            await self._forget([recording_id])
        except CutError as error:
            self.cuts += 1
            self._path_due_s = self._now_s + self._path.next_s()
            await self._apply(recording_id, Event.CUT, str(error))
        except AttemptError as error:
            _log.warning("the upload of %s failed: %s", recording_id, error)
            await self._apply(recording_id, Event.FAILURE, str(error))
        else:
            self._path.reset()
            await self._apply(recording_id, Event.CONFIRMED)

    def _end_attempt(self, recording_id: str) -> None:
        """Ends the attempt on a recording, if there is one. Its callbacks are not called any more."""
        if self._running and self._running[0] == recording_id:
            _, task = self._running
            self._running = None
            task.cancel()
            self._ending.add(task)
            task.add_done_callback(self._ended)

    def _ended(self, task: asyncio.Task[None]) -> None:
        self._ending.discard(task)
        # What it may have ended with in this instant does not count: it is uploaded again.
        if not task.cancelled():
            task.exception()

    async def _closed(self) -> str:
        if not self._settings.store_hosts:
            return "no store is configured: set uploads.store_hosts to HOST:PORT of the fleet's store"
        interface = await self._interface() if self._settings.interfaces else ""
        now = datetime.now().astimezone().time()
        return gates.closed(self._settings, Conditions(interface, now, self._charging()))

    async def _interface(self) -> str:
        """Returns the interface to the host that is sent to; while none is, an allowed one to any of them."""
        sending = self._sender.host if self._sender and self._running else ""
        found = [await interface_to(host) for host in ([sending] if sending else self._settings.hosts)]
        return next((name for name in found if not gates.wrong_interface(self._settings, name)), found[0])

    async def _look_up(self, recording_id: str) -> results.Recording:
        try:
            return await self._source.recording(recording_id)
        except Refused as error:
            if error.reason != Reason.RECORDING_NOT_FOUND:
                raise
            raise NotFoundError(f"there is no recording {recording_id}", Reason.RECORDING_NOT_FOUND) from None

    async def _without_place(self, recording_id: str) -> Upload | None:
        """Queues a recording that is not in the queue, if the recorder expects its copy; otherwise None."""
        recording = await self._look_up(recording_id)
        if not ended(recording) or not _is_wanted(recording, selected=False):
            return None
        upload = step(_new(recording), Event.ENQUEUE, self._now_s)
        return self._uploads.setdefault(recording_id, upload)

    async def _admit(self, upload: Upload) -> None:
        """Queues a recording; in a full queue in the place of the last one, if that runs after it."""
        known = self._uploads.get(upload.recording_id)
        if known and known.state is not State.VERIFIED:
            return  # Queued or cancelled by hand, while another row was written.
        last = last_to_run(self._uploads.values()) if self._room <= 0 else None
        if self._room <= 0 and (last is None or last.order < upload.order):
            self._left_out.add(upload.recording_id)
            return
        self._left_out.remove(upload.recording_id)
        await self._keep(upload)
        await self._displace()

    async def _displace(self) -> None:
        """Takes the last ones of more than MOST_WAITING from the queue.

        The recorder goes on sparing those that it knows of, and its next list has them as wanted.
        """
        while self._room < 0 and (last := last_to_run(self._uploads.values())):
            self._left_out.add(last.recording_id)
            await self._forget([last.recording_id])

    async def _apply(self, recording_id: str, event: Event, reason: str = "") -> None:
        """Changes an upload; not one that was cancelled, or has gone, while another row was written."""
        upload = self._uploads.get(recording_id)
        if upload and event in TRANSITIONS[upload.state]:
            await self._keep(step(upload, event, self._now_s, reason))

    async def _keep(self, upload: Upload) -> None:
        """Takes an upload into the queue, and onto the disk."""
        self._put(upload)
        # First: a full outbox has room for the row then.
        await self._trim()
        try:
            await self._write(upload.recording_id)
        except OSError as error:
            self._note_disk(error)

    async def _trim(self) -> None:
        """Forgets the settled uploads beyond those that are remembered."""
        if forgotten := self._beyond_kept():
            await self._forget(forgotten)

    async def _forget(self, recording_ids: Sequence[str]) -> None:
        for each in recording_ids:
            self._drop(each)
        try:
            async with self._disk:
                # But those that were queued again, while another row was written.
                await self._store.delete_uploads(
                    [each for each in recording_ids if each not in self._uploads]
                )
            self.disk_error = ""
        except OSError as error:
            self._note_disk(error)

    async def _write(self, recording_id: str) -> None:
        """Brings the row of a recording to what it is now; rows are written one after the other.

        Raises:
            OSError: The disk can't be written.
        """
        async with self._disk:
            if upload := self._uploads.get(recording_id):
                await self._store.put_upload(upload)
            else:
                await self._store.delete_uploads([recording_id])
        self.disk_error = ""

    def _drop(self, recording_id: str) -> None:
        self._uploads.pop(recording_id, None)
        self.unconfirmed.removed(recording_id)
        self._changed()

    def _put(self, upload: Upload) -> None:
        before = self._uploads.get(upload.recording_id)
        if before and before.state is not upload.state:
            # In the order of their changes.
            del self._uploads[upload.recording_id]
        self._uploads[upload.recording_id] = upload
        if before is None or (before.state, before.reason) != (upload.state, upload.reason):
            self.unconfirmed.changed(upload.recording_id)
        self._changed()

    def _note_disk(self, error: OSError) -> None:
        self.disk_error = f"the queue of uploads can't be kept on the disk: {error}"
        _log.error("%s", self.disk_error)
        self._changed()

    def _beyond_kept(self) -> list[str]:
        """Returns the settled uploads that are remembered no more.

        The oldest verified ones first: a rule queues none of them again, as the recorder knows them. One that
        it may not know yet stays, so that it is reported: the recorder would go on sparing the recording, and
        have it queued again.
        """
        settled = [each for each in self._uploads.values() if each.state not in WAITING]
        if (beyond := len(settled) - self._most_kept) <= 0:
            return []
        settled.sort(key=lambda each: (each.state is State.LOCAL, each.recording_id in self.unconfirmed))
        return [
            each.recording_id
            for place, each in enumerate(settled[:beyond])
            if place < beyond - _MOST_UNCONFIRMED or each.recording_id not in self.unconfirmed
        ]

    def _has_room_for(self, upload: Upload) -> bool:
        known = self._uploads.get(upload.recording_id)
        if (known is not None and known.state in WAITING) or self._room > 0:
            return True
        # Of two requests by hand the earlier one keeps its place.
        last = last_to_run(self._uploads.values())
        return last is not None and upload.priority < last.priority

    @property
    def _room(self) -> int:
        """How many more may wait."""
        return MOST_WAITING - sum(each.state in WAITING for each in self._uploads.values())

    @property
    def _now_s(self) -> float:
        return asyncio.get_running_loop().time()


def _new(recording: results.Recording, lowest: Priority = Priority.OTHER) -> Upload:
    """Returns the upload of a recording that is not in the queue yet."""
    priority = lowest
    if recording.kind is results.RecordingKind.INCIDENT:
        priority = Priority.INCIDENT
    elif recording.pinned:
        priority = Priority.PINNED
    return Upload(
        recording_id=recording.id,
        label=recording.label,
        priority=priority,
        started_unix_ms=recording.started_unix_ms,
        size=recording.size,
        bundle=recording.kind is results.RecordingKind.RUN_BUNDLE,
    )


def _is_wanted(recording: results.Recording, *, selected: bool) -> bool:
    """Returns whether a recording that the queue does not have is to be copied."""
    match recording.copy.state:
        case results.RecordingCopyState.VERIFIED:
            return False
        case results.RecordingCopyState.UNKNOWN:
            return selected
        case _:
            return True


def _is_known(upload: Upload, copy: results.RecordingCopy) -> bool:
    """Returns whether the recorder has an upload as it is, but for its bytes, which change all the time."""
    return (copy.state, copy.reason) == (_STATES[upload.state], upload.reason)


def _differs(upload: Upload, recording: results.Recording) -> bool:
    """Returns whether a recording is not the one that was verified: a folder of experiments may grow.

    Of one that the robot's disk refuses to read nothing is known: it has failed, and has no files.
    """
    if recording.state is results.RecordingState.FAULTED and not recording.file_count:
        return False
    return recording.size != upload.size or bool(
        recording.sha256 and upload.sha256 and recording.sha256 != upload.sha256
    )


def _selects(rule: str, recording: results.Recording) -> bool:
    incident = recording.kind is results.RecordingKind.INCIDENT
    return {
        "none": False,
        "incidents": incident,
        "pinned": incident or recording.pinned,
        "all": True,
    }[rule]
