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
| the queue on the disk is lost | what the recorder expects to be copied is queued again |

kept_queue.py says what happens where the queue is full, or the bridge's disk fails.
"""

import asyncio
import logging
import random
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Final

from bridge.config import UploadSettings
from bridge.uploads import gates
from bridge.uploads.attempt import Attempt, Parties, RecordingSource, ended
from bridge.uploads.gates import Conditions
from bridge.uploads.kept_queue import KeptQueue
from bridge.uploads.parts import PartSender
from bridge.uploads.problems import AttemptError, CutError, GoneError
from bridge.uploads.queue import (
    LONGEST_PAUSE_S,
    Event,
    Priority,
    State,
    Upload,
    progressed,
    step,
)
from bridge.uploads.receivers import Receivers, Requests
from bridge.uploads.route import interface_to
from bridge.uploads.selection import differs, is_known, is_wanted, new_upload, selects
from common.errors import NotFoundError, PreconditionError
from common.jittered_backoff import JitteredBackoff
from common.reasons import Reason
from console.client import results
from console.client.errors import Refused

_log = logging.getLogger(__name__)

_TICK_S: Final = 1.0
"""How often the gates are looked at."""
OPENING_SPREAD_S: Final = 30.0
"""After the gates have opened where hours are set: those of a whole fleet may begin in the same second."""
_RATE_TICKS: Final = 5
"""Over how many the rate is measured."""


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
    """What fills the queue of uploads, and works on it. Used on one event loop.

    Args:
        settings: When, and where to.
        fleet: As whom.
        queue: The uploads.
        source: The robot's gateway, with the role of a viewer.
        hub: The connection to the hub.
        charging: Returns whether the main battery is being charged; None if unknown.
        changed: Called when it pauses, or goes on.

    Attributes:
        queue: The uploads.
        paused: Why nothing is uploaded although something waits, for people. Otherwise empty.
        cuts: Attempts that ended because the gateway, the hub or the store failed, since the start.
    """

    def __init__(
        self,
        settings: UploadSettings,
        fleet: Fleet,
        *,
        queue: KeptQueue,
        source: RecordingSource,
        hub: Requests,
        charging: Callable[[], bool | None],
        changed: Callable[[], None],
    ) -> None:
        self._settings, self._fleet = settings, fleet
        self.queue, self._source, self._hub = queue, source, hub
        self._charging, self._changed = charging, changed
        self._wake = asyncio.Event()
        # A receiver that fails, or is busy, is so for a whole fleet at once.
        self._path = JitteredBackoff(LONGEST_PAUSE_S)
        self._path_due_s = 0.0
        self._running: tuple[str, asyncio.Task[None]] | None = None
        self._ending = set[asyncio.Task[None]]()
        """Attempts that were cancelled and still close their connections."""
        self._sender: PartSender | None = None
        self._sent = deque[tuple[float, int]](maxlen=_RATE_TICKS)
        self.paused = ""
        self.cuts = 0

    @property
    def current(self) -> Upload | None:
        """The one that is being uploaded or verified."""
        return self.queue.get(self._running[0]) if self._running else None

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
        await self.queue.loaded.wait()
        recording = await self._look_up(recording_id)
        if not ended(recording):
            raise PreconditionError(f"{recording_id} has not ended", Reason.RECORDING_RUNS)
        upload = self.queue.get(recording_id) or new_upload(recording, Priority.BY_HAND)
        if upload.state is State.VERIFIED and differs(upload, recording):
            upload = step(upload, Event.CHANGED, self._now_s)
        else:
            upload = step(upload, Event.ENQUEUE, self._now_s)
        upload = replace(upload, priority=min(upload.priority, Priority.BY_HAND))
        upload = await self.queue.request(upload)
        # An operator who asks again does not wait for the end of a pause.
        self._path_due_s = 0.0
        self._wake.set()
        return upload

    async def cancel(self, recording_id: str) -> Upload:
        """Takes a recording from the queue; a copy that is verified stays. No rule puts it back.

        Returns:
            The upload as it was.

        Raises:
            GatewayError: It is not in the queue, and the gateway does not answer whether it is to be.
            NotFoundError: It is not in the queue.
        """
        await self.queue.loaded.wait()
        upload = self.queue.get(recording_id) or await self._without_place(recording_id)
        if upload is None or upload.state is State.LOCAL:
            raise NotFoundError(f"{recording_id} is not in the queue of uploads", Reason.RECORDING_NOT_FOUND)
        if upload.state is not State.VERIFIED:
            self._end_attempt(recording_id)
            await self.queue.apply(recording_id, Event.REMOVE)
            self._wake.set()
        return upload

    async def consider(self, recordings: Iterable[results.Recording]) -> None:
        """Takes recordings of the recorder's list, and queues those that have ended and are to be copied.

        Those are what the rule selects, and what the recorder expects to be copied although it is not in the
        queue: that was lost with the bridge's disk, or has lost its place. The list begins with the newest:
        once the queue is full, those that go before others take the places of the last ones.
        """
        await self.queue.loaded.wait()
        wanted = []
        for recording in recordings:
            known = self.queue.get(recording.id)
            if known:
                self.queue.unconfirmed.listed(recording.id, confirmed=is_known(known, recording.copy))
            if not ended(recording):
                continue
            selected = selects(self._settings.rule, recording)
            if known is None and is_wanted(recording, selected=selected):
                lowest = Priority.OTHER if selected else Priority.BY_HAND
                wanted.append(step(new_upload(recording, lowest), Event.ENQUEUE, self._now_s))
            elif known and selected and known.state is State.VERIFIED and differs(known, recording):
                wanted.append(step(known, Event.CHANGED, self._now_s))
        for upload in sorted(wanted, key=lambda each: each.order):
            await self.queue.admit(upload)
        self._wake.set()

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
                    await self.queue.load()
                    await self._tick()
                    await self._next_tick()
        finally:
            waiter.cancel()
            if self._running:
                self._end_attempt(self._running[0])
            await asyncio.gather(*self._ending, return_exceptions=True)

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
        closed = await self._closed() if self.queue.waiting else ""
        if closed != self.paused:
            if not closed and self._settings.hours:
                opens_s = self._now_s + random.uniform(0.0, OPENING_SPREAD_S)  # noqa: S311  # no secret
                self._path_due_s = max(self._path_due_s, opens_s)
            self.paused = closed
            self._changed()
        if not closed:
            for each in self.queue.waiting:
                if each.state is State.PAUSED:
                    await self.queue.apply(each.recording_id, Event.RESUME)
        head = self.queue.next(path_works=not self._path.failures)
        if closed:
            await self._pause(head, closed)
        elif head:
            await self._advance(head)

    async def _pause(self, head: Upload | None, closed: str) -> None:
        current = self.current
        # A receiver reads without this robot's network.
        if current and current.state is State.UPLOADING:
            self._end_attempt(current.recording_id)
            await self.queue.apply(current.recording_id, Event.PAUSE, closed)
        elif head and not current and head.reason != closed:
            if head.state is State.FAILED:
                await self.queue.apply(head.recording_id, Event.RESUME)
            await self.queue.apply(head.recording_id, Event.PAUSE, closed)

    async def _advance(self, head: Upload) -> None:
        current = self.current
        if current and head.priority < current.priority and current.state is State.UPLOADING:
            self._end_attempt(current.recording_id)
            await self.queue.apply(current.recording_id, Event.GIVE_WAY)
        if not self._running and self._now_s >= self._path_due_s:
            if head.state is not State.QUEUED:
                await self.queue.apply(head.recording_id, Event.RESUME)
            await self.queue.apply(head.recording_id, Event.BEGIN)
            begun = self.queue.get(head.recording_id)
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
            self.queue.put(replace(self.queue[recording_id], size=size, sha256=sha256))

        def progress(done: int) -> None:
            upload = self.queue[recording_id]
            if done > upload.bytes_done:
                self._path.reset()
            self.queue.put(progressed(upload, done))

        def sent() -> None:
            self.queue.put(step(self.queue[recording_id], Event.SENT, self._now_s))

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
            await self.queue.forget([recording_id])
        except CutError as error:
            self.cuts += 1
            self._path_due_s = self._now_s + self._path.next_s()
            await self.queue.apply(recording_id, Event.CUT, str(error))
        except AttemptError as error:
            _log.warning("the upload of %s failed: %s", recording_id, error)
            await self.queue.apply(recording_id, Event.FAILURE, str(error))
        else:
            self._path.reset()
            await self.queue.apply(recording_id, Event.CONFIRMED)

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
        return gates.closed(self._settings, Conditions(interface, datetime.now(UTC), self._charging()))

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
        if not ended(recording) or not is_wanted(recording, selected=False):
            return None
        upload = step(new_upload(recording), Event.ENQUEUE, self._now_s)
        return self.queue.add(upload)

    @property
    def _now_s(self) -> float:
        return asyncio.get_running_loop().time()
