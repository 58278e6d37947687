"""What uploads work with in tests: recordings and queue in memory, and a receiver in this process."""

import asyncio
import hashlib
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from bridge.config import UploadSettings
from bridge.uploads.attempt import RecordingSource
from bridge.uploads.kept_queue import KeptQueue
from bridge.uploads.queue import MOST_KEPT, Upload
from bridge.uploads.receivers import Requests
from bridge.uploads.uploads import Fleet, Uploads
from common.healthcheck import state_of
from console.client import results
from console.client.errors import GatewayError, Refused
from console.client.mapping.reader import read
from fleet.receipt_keys import ReceiptSigner, new_seed
from hub.receiver.app import serve
from hub.receiver.config import HubSettings, ReceiverSettings, StoreSettings
from omniseer.gateway.v1 import recording_pb2 as pb
from tests.support.eventually import eventually
from tests.support.secure_hub import SecureHub

FLEET: Final = "lab"
ROBOT: Final = "r1"
MIB: Final = 1024 * 1024
_CHUNK: Final = 256 * 1024


def content(size: int, seed: int = 0) -> bytes:
    """Bytes that differ everywhere, the same ones each time."""
    block = hashlib.shake_128(seed.to_bytes(4)).digest(min(size, MIB + 13))
    return (block * (size // len(block) + 1))[:size] if size else b""


def recording(recording_id: str, files: dict[str, bytes], **more: Any) -> results.Recording:
    """A recording that has ended, with its files."""
    message = pb.Recording(
        id=recording_id,
        state=more.pop("state", pb.RECORDING_STATE_COMPLETE),
        started_unix_ms=more.pop("started_unix_ms", 1),
        size=sum(map(len, files.values())),
        file_count=len(files),
        files=[
            pb.RecordingFile(name=name, size=len(data), sha256=hashlib.sha256(data).digest(), final=True)
            for name, data in sorted(files.items())
        ],
        **more,
    )
    return read(results.Recording, message)


@dataclass
class Robot:
    """A gateway, as uploads see it.

    Attributes:
        recordings: by ID.
        contents: of files, by recording and name.
        failure: what reading ends with, once.
        fails_at: after so many bytes of a reading.
        opened: offsets at which files were opened, in order.
    """

    recordings: dict[str, results.Recording] = field(default_factory=dict)
    contents: dict[tuple[str, str], bytes] = field(default_factory=dict)
    failure: GatewayError | None = None
    fails_at: int = 0
    opened: list[int] = field(default_factory=list)

    def add(self, recording_id: str, files: dict[str, bytes], **more: Any) -> results.Recording:
        found = recording(recording_id, files, **more)
        self.recordings[recording_id] = found
        self.contents.update({(recording_id, name): data for name, data in files.items()})
        return found

    def delete(self, recording_id: str) -> None:
        del self.recordings[recording_id]

    async def recording(self, recording_id: str) -> results.Recording:
        if found := self.recordings.get(recording_id):
            return found
        error = Refused(f"no recording {recording_id}")
        error.reason = "RECORDING_NOT_FOUND"
        raise error

    async def read_recording(
        self, recording_id: str, file: results.RecordingFile, offset: int = 0
    ) -> AsyncGenerator[bytes]:
        self.opened.append(offset)
        data, done = self.contents[recording_id, file.name], 0
        while offset < len(data):
            if self.failure and done >= self.fails_at:
                failure, self.failure = self.failure, None
                raise failure
            yield data[offset : offset + _CHUNK]
            offset += _CHUNK
            done += _CHUNK


class Rows:
    """A queue's store in memory; what a restart would find."""

    def __init__(self) -> None:
        self.rows: dict[str, Upload] = {}
        self.full = False

    async def uploads(self) -> list[Upload]:
        return [replace(each, due_s=0.0) for each in self.rows.values()]

    async def put_upload(self, upload: Upload) -> None:
        if self.full:
            raise OSError(28, "No space left on device")
        self.rows[upload.recording_id] = upload

    async def delete_uploads(self, recording_ids: Sequence[str]) -> None:
        for each in recording_ids:
            self.rows.pop(each, None)


def new_signer() -> ReceiptSigner:
    """Signs with a new key."""
    return ReceiptSigner(new_seed())


def receiver_settings(
    hub: SecureHub, store: StoreSettings, directory: Path, number: int = 1
) -> ReceiverSettings:
    """Settings of a receiver with credentials that the hub's administration has issued."""
    files = hub.path / "receiver"
    address = hub.address(files / "receiver.creds")
    return ReceiverSettings(
        fleet=FLEET,
        hub=HubSettings(servers=address.servers, credentials=address.credentials, ca=address.ca),
        store=store,
        signing_key=files / "receipts.key",
        socket=directory / f"receiver-{number}.sock",
    )


@asynccontextmanager
async def running_receiver(settings: ReceiverSettings) -> AsyncIterator[None]:
    """A receiver in this process: connected when the block begins, gone when it ends."""
    stop = asyncio.Event()
    task = asyncio.create_task(serve(settings, stop))

    async def state() -> str:
        assert not task.done(), task.exception()
        return await asyncio.to_thread(state_of, f"unix:{settings.socket}", "receiver")

    try:
        await eventually(state, lambda now: now == "SERVING", "the receiver serves")
        yield
    finally:
        stop.set()
        await task


@dataclass
class Running:
    """Uploads that run."""

    uploads: Uploads
    rows: Rows
    changes: int = 0

    def upload(self, recording_id: str) -> Upload | None:
        return next(
            (
                each
                for each in (*self.uploads.queue.waiting, *self.uploads.queue.settled)
                if each.recording_id == recording_id
            ),
            None,
        )

    async def until(
        self, recording_id: str, holds: Callable[[Upload | None], object], within_s: float = 30.0
    ) -> Upload | None:
        async def ask() -> Upload | None:
            return self.upload(recording_id)

        return await eventually(ask, holds, recording_id, within_s)


@asynccontextmanager
async def running_uploads(
    robot: RecordingSource,
    hub: Requests,
    host: str,
    keys: tuple[bytes, ...],
    rows: Rows | None = None,
    *,
    charging: Callable[[], bool | None] = lambda: None,
    most_kept: int = MOST_KEPT,
    **settings: Any,
) -> AsyncIterator[Running]:
    """Uploads as a bridge runs them; ended in order when the block ends."""
    rows = rows or Rows()

    def changed() -> None:
        running.changes += 1

    running = Running(
        Uploads(
            UploadSettings.model_validate({"store_hosts": (host,), "insecure_store": True} | settings),
            Fleet(fleet=FLEET, robot=ROBOT, keys=keys),
            queue=KeptQueue(rows, changed, most_kept=most_kept),
            source=robot,
            hub=hub,
            charging=charging,
            changed=changed,
        ),
        rows,
    )
    stop = asyncio.Event()
    task = asyncio.create_task(running.uploads.run(stop))
    try:
        await running.uploads.queue.loaded.wait()
        yield running
        assert not task.done(), "it runs until it is stopped"
    finally:
        stop.set()
        await task
