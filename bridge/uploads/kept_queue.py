"""The uploads of a bridge, in memory and on its disk: those that wait, and those that are remembered.

| what happens | what follows |
|---|---|
| the queue is full | a more urgent recording takes the last one's place, which competes for one again |
| that is a run bundle, requested by hand | it keeps its place, as nothing else knows of the request |
| the disk can't be read | again after 1, 2, 4 ... 300 s; what has happened meanwhile counts |
| the disk can't be written | memory goes on; `disk_error` says why; a new request is refused |
| an upload changes while another row is written | its row is written as it is by then |
| more are remembered than may be | the oldest verified ones, which the recorder has as they are, go first |
"""

import asyncio
import logging
from collections.abc import Callable, Sequence
from typing import Final

from bridge.uploads.left_out import LeftOut
from bridge.uploads.queue import (
    FIRST_PAUSE_S,
    LONGEST_PAUSE_S,
    MOST_KEPT,
    MOST_WAITING,
    TRANSITIONS,
    WAITING,
    Event,
    State,
    Upload,
    UploadStore,
    in_order,
    last_to_run,
    next_upload,
    step,
)
from bridge.uploads.unconfirmed import Unconfirmed
from common.backoff import Backoff
from common.errors import TooMuchError
from common.reasons import Reason

_log = logging.getLogger(__name__)

_MOST_UNCONFIRMED: Final = 256
"""Uploads that are remembered beyond the others until the recorder knows them; run bundles it never does."""


class KeptQueue:
    """The uploads. Used on one event loop.

    Args:
        store: Keeps them.
        changed: Called after each change that is worth a report.
        most_kept: Uploads that wait no more and are remembered; the store may have room for fewer.

    Attributes:
        unconfirmed: Those that the recorder may not have as they are.
        left_out: Those that are to be copied and find no place.
        loaded: Set once they have been read from the disk, or that has failed.
        disk_error: Why they can't be kept on the disk; empty when all is well.
    """

    def __init__(
        self, store: UploadStore, changed: Callable[[], None], *, most_kept: int = MOST_KEPT
    ) -> None:
        self._store, self._changed, self._most_kept = store, changed, most_kept
        self._uploads: dict[str, Upload] = {}
        """The one that changed last is the last."""
        self._disk = asyncio.Lock()
        self._load_pause = Backoff(FIRST_PAUSE_S, LONGEST_PAUSE_S)
        self._load_due_s = 0.0
        self.unconfirmed = Unconfirmed()
        self.left_out = LeftOut()
        self.loaded = asyncio.Event()
        self.disk_error = ""

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

    def __getitem__(self, recording_id: str) -> Upload:
        return self._uploads[recording_id]

    def next(self, *, path_works: bool) -> Upload | None:
        """Returns the one to upload now; see `next_upload`."""
        return next_upload(self._uploads.values(), self._now_s, path_works=path_works)

    async def load(self) -> None:
        """Reads them from the disk, once; where that fails, again at a later call.

        What has happened to a recording meanwhile counts.
        """
        if self._now_s < self._load_due_s:
            return
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

    def begin_listing(self) -> None:
        """Takes that the recorder's list is read from its beginning; `Uploads.consider` takes its pages."""
        self.unconfirmed.begin_listing()
        self.left_out.begin_listing()

    def end_listing(self) -> None:
        """Takes that the recorder's list was read to its end."""
        self.unconfirmed.end_listing()
        if self.left_out.end_listing():
            if count := self.left_out.count:
                _log.warning(
                    "%d recordings are to be copied and find no place: %d wait already", count, MOST_WAITING
                )
            else:
                _log.info("all recordings that are to be copied have a place in the queue again")
            self._changed()

    async def request(self, upload: Upload) -> Upload:
        """Queues a recording on request, or leaves it where it waits.

        Returns:
            The upload, as it is once it is on the disk.

        Raises:
            TooMuchError: The queue, or the bridge's disk, is full.
        """
        if upload.state in WAITING and not self._has_room_for(upload):
            raise TooMuchError(f"{MOST_WAITING} recordings wait to be uploaded", Reason.TOO_MANY_REQUESTS)
        is_new = upload.recording_id not in self._uploads
        self.put(upload)
        try:
            await self._write(upload.recording_id)
        except OSError as error:
            if is_new:
                self._drop(upload.recording_id)
            raise TooMuchError(f"the bridge's disk can't be written: {error}", Reason.DISK_FULL) from error
        await self._displace()
        return self._uploads.get(upload.recording_id, upload)

    async def admit(self, upload: Upload) -> None:
        """Queues a recording; in a full queue in the place of the last one, if that runs after it."""
        known = self._uploads.get(upload.recording_id)
        if known and known.state is not State.VERIFIED:
            return  # Queued or cancelled by hand, while another row was written.
        last = last_to_run(self._uploads.values()) if self._room <= 0 else None
        if self._room <= 0 and (last is None or last.order < upload.order):
            self.left_out.add(upload.recording_id)
            return
        self.left_out.remove(upload.recording_id)
        await self._keep(upload)
        await self._displace()

    async def apply(self, recording_id: str, event: Event, reason: str = "") -> None:
        """Changes an upload; not one that was cancelled, or has gone, while another row was written."""
        upload = self._uploads.get(recording_id)
        if upload and event in TRANSITIONS[upload.state]:
            await self._keep(step(upload, event, self._now_s, reason))

    def put(self, upload: Upload) -> None:
        """Takes an upload as it is now, in memory alone."""
        before = self._uploads.get(upload.recording_id)
        if before and before.state is not upload.state:
            # In the order of their changes.
            del self._uploads[upload.recording_id]
        self._uploads[upload.recording_id] = upload
        if before is None or (before.state, before.reason) != (upload.state, upload.reason):
            self.unconfirmed.changed(upload.recording_id)
        self._changed()

    def add(self, upload: Upload) -> Upload:
        """Takes an upload in memory alone; returns the one of its recording that there is already, if any."""
        return self._uploads.setdefault(upload.recording_id, upload)

    async def forget(self, recording_ids: Sequence[str]) -> None:
        """Takes uploads from memory and disk."""
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

    async def _displace(self) -> None:
        """Takes the last ones of more than MOST_WAITING from the queue.

        The recorder goes on sparing those that it knows of, and its next list has them as wanted.
        """
        while self._room < 0 and (last := last_to_run(self._uploads.values())):
            self.left_out.add(last.recording_id)
            await self.forget([last.recording_id])

    def _has_room_for(self, upload: Upload) -> bool:
        """Returns whether a request may be queued, if need be in the place of one that is less urgent."""
        known = self._uploads.get(upload.recording_id)
        if (known is not None and known.state in WAITING) or self._room > 0:
            return True
        # Of two requests by hand the earlier one keeps its place.
        last = last_to_run(self._uploads.values())
        return last is not None and upload.priority < last.priority

    async def _keep(self, upload: Upload) -> None:
        """Takes an upload into the queue, and onto the disk."""
        self.put(upload)
        # First: a full outbox has room for the row then.
        await self._trim()
        try:
            await self._write(upload.recording_id)
        except OSError as error:
            self._note_disk(error)

    async def _trim(self) -> None:
        """Forgets the settled uploads beyond those that are remembered."""
        if forgotten := self._beyond_kept():
            await self.forget(forgotten)

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

    @property
    def _room(self) -> int:
        """How many more may wait."""
        return MOST_WAITING - sum(each.state in WAITING for each in self._uploads.values())

    @property
    def _now_s(self) -> float:
        return asyncio.get_running_loop().time()
