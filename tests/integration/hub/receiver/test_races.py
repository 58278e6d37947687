"""Receivers that stall between a look at the store and what follows from it, while others go on."""

import asyncio
import hashlib
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import pytest
from google.protobuf.message import Message

from fleet.receipt_keys import ReceiptSigner, confirmed
from hub.receiver.service import ReceiverService
from hub.receiver.store import Store
from hub.receiver.verified import THREADS, Party
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1.recording_pb2 import RecordingFile
from tests.support.s3_server import S3Server
from tests.support.uploading import FLEET, ROBOT, new_signer

DATA = b"the robot's bytes"
KEY = f"{FLEET}/{ROBOT}/one/data.bin"


def file_of(data: bytes) -> RecordingFile:
    return RecordingFile(name="data.bin", size=len(data), sha256=hashlib.sha256(data).digest(), final=True)


class Stalling:
    """A store whose user stalls before a call of one method, until it is released.

    Args:
        store: does what is called.
        method: its name.
    """

    def __init__(self, store: Store, method: str) -> None:
        self._store, self._method = store, method
        self.reached = threading.Event()
        self.released = threading.Event()

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._store, name)
        if name != self._method:
            return found

        def stalled(*args: Any, **more: Any) -> Any:
            self.reached.set()
            assert self.released.wait(30)
            return found(*args, **more)

        return stalled


class Bucket:
    """A bucket with any number of receivers."""

    def __init__(self, server: S3Server, threads: ThreadPoolExecutor) -> None:
        self.client = server.client
        self.settings = server.settings()
        self.name = self.settings.bucket
        self.store = Store(self.settings)
        self._threads = threads
        self._signer: ReceiptSigner = new_signer()

    def receiver(self, store: Any = None) -> "Receiver":
        party = Party(FLEET, self._signer, (self._signer.public_key,))
        records: Any = Records()
        return Receiver(ReceiverService(party, store or self.store, records, self._threads))

    def content(self) -> bytes | None:
        found = self.client.list_objects_v2(Bucket=self.name, Prefix=KEY).get("Contents", [])
        return self.client.get_object(Bucket=self.name, Key=KEY)["Body"].read() if found else None

    def parts(self, data: bytes) -> pb.CompleteFileRequest:
        """Sends the only part of a file in an upload of its own; returns the request to complete it."""
        upload_id = self.client.create_multipart_upload(Bucket=self.name, Key=KEY)["UploadId"]
        sent = self.client.upload_part(Bucket=self.name, Key=KEY, UploadId=upload_id, PartNumber=1, Body=data)
        parts = [pb.Part(number=1, etag=sent["ETag"])]
        return pb.CompleteFileRequest(
            recording_id="one", file_name="data.bin", upload_id=upload_id, parts=parts
        )

    def is_confirmed(self, receipt: pb.SignedReceipt, file: RecordingFile) -> bool:
        expected = pb.Receipt(
            fleet=FLEET,
            robot=ROBOT,
            recording_id="one",
            file_name=file.name,
            size=file.size,
            sha256=file.sha256,
        )
        return bool(confirmed(receipt, (self._signer.public_key,), expected))


class Records:
    """Lists nothing."""

    async def put(self, _bucket: str, _key: str, _value: bytes) -> None:
        pass


class Receiver:
    """Asks a receiver without a hub between."""

    def __init__(self, service: ReceiverService) -> None:
        self._service = service

    async def ask(self, name: str, request: Message) -> pb.UploadResponse:
        answers: list[pb.UploadResponse] = []

        async def send(answer: pb.UploadResponse) -> None:
            answers.append(answer)

        await self._service.answer(ROBOT, name, request.SerializeToString(), send)
        return answers[-1]

    async def verify(self, file: RecordingFile) -> pb.UploadResponse:
        return await self.ask("verify_file", pb.VerifyFileRequest(recording_id="one", file=file))


@pytest.fixture
def bucket(store_server: S3Server) -> Iterator[Bucket]:
    with ThreadPoolExecutor(THREADS) as threads:
        made = Bucket(store_server, threads)
        yield made
        made.store.close()


@contextmanager
def stalling(bucket: Bucket, method: str) -> Iterator[tuple[Receiver, Stalling]]:
    store = Stalling(bucket.store, method)
    try:
        yield bucket.receiver(store), store
    finally:
        store.released.set()


async def reached(store: Stalling) -> None:
    assert await asyncio.to_thread(store.reached.wait, 20)


async def test_what_was_received_and_verified_meanwhile_is_not_deleted(bucket: Bucket) -> None:
    other, file = bucket.receiver(), file_of(DATA)
    await other.ask("complete_file", bucket.parts(b"the robot's bytez"))
    with stalling(bucket, "delete") as (receiver, store):
        stalled = asyncio.create_task(receiver.verify(file))
        await reached(store)
        assert (await other.verify(file)).error.code == pb.UPLOAD_ERROR_CODE_WRONG_CONTENT
        await other.ask("complete_file", bucket.parts(DATA))
        receipt = (await other.verify(file)).verify_file.receipt
        assert bucket.is_confirmed(receipt, file)
        store.released.set()
        assert (await stalled).error.code == pb.UPLOAD_ERROR_CODE_STORE, "the robot asks again"
    assert bucket.content() == DATA
    assert (await receiver.verify(file)).verify_file.receipt == receipt


async def test_what_was_verified_meanwhile_is_not_overwritten(bucket: Bucket) -> None:
    other, file = bucket.receiver(), file_of(DATA)
    with stalling(bucket, "complete") as (receiver, store):
        late = asyncio.create_task(receiver.ask("complete_file", bucket.parts(b"later bytes")))
        await reached(store)
        await other.ask("complete_file", bucket.parts(DATA))
        assert bucket.is_confirmed((await other.verify(file)).verify_file.receipt, file)
        store.released.set()
        assert (await late).HasField("complete_file")
    assert bucket.content() == DATA


async def test_an_empty_file_takes_the_place_of_no_other(bucket: Bucket) -> None:
    other, file = bucket.receiver(), file_of(DATA)
    request = pb.BeginFileRequest(recording_id="one", file=file_of(b""))
    with stalling(bucket, "create") as (receiver, store):
        late = asyncio.create_task(receiver.ask("begin_file", request))
        await reached(store)
        await other.ask("complete_file", bucket.parts(DATA))
        assert bucket.is_confirmed((await other.verify(file)).verify_file.receipt, file)
        store.released.set()
        assert (await late).HasField("begin_file")
    assert bucket.content() == DATA


async def test_what_is_gone_when_it_has_been_read_gets_no_receipt(bucket: Bucket) -> None:
    other, file = bucket.receiver(), file_of(DATA)
    await other.ask("complete_file", bucket.parts(DATA))
    with stalling(bucket, "write") as (receiver, store):
        late = asyncio.create_task(receiver.verify(file))
        await reached(store)
        bucket.client.delete_object(Bucket=bucket.name, Key=KEY)
        store.released.set()
        assert (await late).error.code == pb.UPLOAD_ERROR_CODE_STORE
    assert (await other.verify(file)).error.code == pb.UPLOAD_ERROR_CODE_NO_SUCH_UPLOAD
    assert not bucket.client.list_objects_v2(Bucket=bucket.name).get("Contents"), "nor is one kept"
