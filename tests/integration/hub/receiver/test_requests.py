"""What a receiver answers to robots that send anything, and what it never does."""

import asyncio
import hashlib
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from google.protobuf.message import Message

from bridge.uploads.receivers import Receivers
from common.healthcheck import state_of
from fleet.connection import FleetAddress, Hub, connect
from fleet.names import reading_subject, upload_subject
from hub.receiver.app import AT_ONCE, sweep
from hub.receiver.store import PART_BYTES, OpenUpload, Store
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1.recording_pb2 import Recording, RecordingFile
from tests.support.free import free_tcp_port
from tests.support.secure_hub import SecureHub
from tests.support.upload_ground import Ground
from tests.support.uploading import FLEET, ROBOT, running_receiver

DATA = b"some bytes"
FILE = RecordingFile(name="data.bin", size=len(DATA), sha256=hashlib.sha256(DATA).digest(), final=True)


async def ask(hub: Hub, name: str, request: Message | bytes, robot: str = ROBOT) -> pb.UploadResponse:
    payload = request if isinstance(request, bytes) else request.SerializeToString()
    return pb.UploadResponse.FromString(await hub.request(upload_subject(robot, name), payload, 20))


@asynccontextmanager
async def receiving(ground: Ground) -> AsyncIterator[Receivers]:
    async with running_receiver(ground.receivers[0]):
        yield Receivers(ground.hub, ROBOT)


async def uploaded(receivers: Receivers, data: bytes = DATA, file: RecordingFile = FILE) -> None:
    """A file of the recording "one" in the store, not read again yet."""
    begun = await receivers.begin_file("one", file)
    (url,) = await receivers.part_urls("one", file, begun.upload_id, [1])
    async with aiohttp.ClientSession() as session, session.put(url.url, data=data) as answer:
        assert answer.status == 200
        etag = answer.headers["ETag"]
    await receivers.complete_file("one", file, begun.upload_id, [etag])


@pytest.mark.parametrize(
    ("name", "request_"),
    [
        ("begin_upload", b"\xff\xff"),
        ("no_such_request", b""),
        ("begin_upload", pb.BeginUploadRequest(recording=Recording(id="../r2"))),
        (
            "begin_file",
            pb.BeginFileRequest(
                recording_id="one", file=RecordingFile(name="../two/x", size=1, sha256=b"s" * 32)
            ),
        ),
        ("begin_file", pb.BeginFileRequest(recording_id="one.receipts", file=FILE)),
        ("begin_file", pb.BeginFileRequest(recording_id="one", file=RecordingFile(name="x", size=1))),
        (
            "begin_file",
            pb.BeginFileRequest(
                recording_id="one", file=RecordingFile(name="x", size=2**63, sha256=b"s" * 32)
            ),
        ),
        (
            "get_parts",
            pb.GetPartsRequest(
                recording_id="one", file_name="x", upload_id="u", numbers=range(1, 18), file_size=2**40
            ),
        ),
        (
            "get_parts",
            pb.GetPartsRequest(
                recording_id="one", file_name="x", upload_id="u", numbers=[2], file_size=PART_BYTES
            ),
        ),
        (
            "complete_file",
            pb.CompleteFileRequest(
                recording_id="one", file_name="x", upload_id="u", parts=[pb.Part(number=2, etag="e")]
            ),
        ),
        ("complete_file", pb.CompleteFileRequest(recording_id="one", file_name="x", upload_id="u")),
        ("verify_file", pb.VerifyFileRequest(recording_id="", file=FILE)),
        ("complete_upload", pb.CompleteUploadRequest(recording=Recording(id="one"))),
        (
            "complete_upload",
            pb.CompleteUploadRequest(recording=Recording(id="one"), file_names=["/etc/passwd"]),
        ),
    ],
)
async def test_what_is_invalid_is_refused_and_changes_nothing(
    ground: Ground, name: str, request_: Message | bytes
) -> None:
    async with receiving(ground):
        answer = await ask(ground.hub, name, request_)
    assert answer.error.code == pb.UPLOAD_ERROR_CODE_INVALID
    assert answer.error.message
    client = ground.server.client
    assert not client.list_objects_v2(Bucket=ground.store.bucket).get("Contents")
    assert not client.list_multipart_uploads(Bucket=ground.store.bucket).get("Uploads")


async def test_a_url_is_for_one_part_of_one_file_and_its_length_is_signed(ground: Ground) -> None:
    async with receiving(ground) as receivers:
        begun = await receivers.begin_file("one", FILE)
        (url,) = await receivers.part_urls("one", FILE, begun.upload_id, [1])
    assert url.expires_in_s == 900
    assert f"/{FLEET}/{ROBOT}/one/data.bin?" in url.url
    assert "partNumber=1" in url.url
    assert "X-Amz-SignedHeaders=content-length%3Bhost" in url.url
    assert "X-Amz-Expires=900" in url.url


async def test_a_verified_file_is_never_overwritten(ground: Ground) -> None:
    async with receiving(ground) as receivers:
        await uploaded(receivers)
        first = await receivers.verify_file("one", FILE)
        assert await receivers.verify_file("one", FILE) == first, "the receipt of before"
        other = b"other data"
        changed = RecordingFile(
            name=FILE.name, size=len(other), sha256=hashlib.sha256(other).digest(), final=True
        )
        request = pb.BeginFileRequest(recording_id="one", file=changed)
        refused = await ask(ground.hub, "begin_file", request)
        assert refused.error.code == pb.UPLOAD_ERROR_CODE_INVALID
        assert "verified with other content" in refused.error.message
    key = f"{FLEET}/{ROBOT}/one/data.bin"
    found = ground.server.client.get_object(Bucket=ground.store.bucket, Key=key)
    assert found["Body"].read() == DATA


async def test_wrong_bytes_are_deleted_and_get_no_receipt(ground: Ground) -> None:
    async with receiving(ground) as receivers:
        for wrong in (b"some bytez", b"short"):
            await uploaded(receivers, wrong)
            answer = await ask(ground.hub, "verify_file", pb.VerifyFileRequest(recording_id="one", file=FILE))
            while answer.HasField("verify_file") and not answer.verify_file.HasField("receipt"):
                answer = await ask(
                    ground.hub, "verify_file", pb.VerifyFileRequest(recording_id="one", file=FILE)
                )
            assert answer.error.code in {
                pb.UPLOAD_ERROR_CODE_WRONG_CONTENT,
                # Asked once more, while the first request has deleted it.
                pb.UPLOAD_ERROR_CODE_NO_SUCH_UPLOAD,
            }
            assert not ground.server.client.list_objects_v2(Bucket=ground.store.bucket).get("Contents")


async def test_a_recording_whose_files_are_not_verified_gets_no_receipt(ground: Ground) -> None:
    async with receiving(ground) as receivers:
        await uploaded(receivers)
        recording = Recording(id="one", size=len(DATA), sha256=b"s" * 32)
        request = pb.CompleteUploadRequest(recording=recording, file_names=["data.bin"])
        answers = [
            pb.UploadResponse.FromString(each)
            async for each in _until_last(ground.hub, "complete_upload", request)
        ]
        assert answers[-1].error.code == pb.UPLOAD_ERROR_CODE_NOT_VERIFIED
        await receivers.verify_file("one", FILE)
        answers = [
            pb.UploadResponse.FromString(each)
            async for each in _until_last(ground.hub, "complete_upload", request)
        ]
        assert answers[-1].error.code == pb.UPLOAD_ERROR_CODE_NOT_VERIFIED, "the sum is another one"


async def test_a_robot_gets_to_its_own_recordings_alone(ground: Ground, secure: SecureHub) -> None:
    """The robot is that of the subject, which the hub enforces, whatever the payload says."""
    await asyncio.to_thread(secure.enroll, "r2") if not (secure.path / "r2").exists() else None
    address: FleetAddress = secure.address(secure.path / "r2" / "bridge.creds", "_INBOX_r2")
    async with receiving(ground) as receivers, connect(address) as other:
        await other.connected(20)
        await uploaded(receivers)
        request = pb.BeginFileRequest(recording_id="one", file=FILE)
        mine = await ask(other, "begin_file", request, "r2")
        assert mine.begin_file.upload_id, "of r2, a recording of that name is not there yet"
        with pytest.raises(Exception, match="do not permit"):
            await ask(other, "begin_file", request, ROBOT)
    uploads = ground.server.client.list_multipart_uploads(Bucket=ground.store.bucket)["Uploads"]
    assert [each["Key"] for each in uploads] == [f"{FLEET}/r2/one/data.bin"]


async def test_beyond_eight_requests_at_once_it_is_busy(ground: Ground) -> None:
    request = pb.VerifyFileRequest(recording_id="one", file=FILE)
    async with receiving(ground):
        answers = await asyncio.gather(*(ask(ground.hub, "verify_file", request) for _ in range(6 * AT_ONCE)))
    codes = {answer.error.code for answer in answers}
    assert codes == {pb.UPLOAD_ERROR_CODE_BUSY, pb.UPLOAD_ERROR_CODE_NO_SUCH_UPLOAD}


async def test_abandoned_uploads_are_swept_by_two_at_once(ground: Ground) -> None:
    client, bucket = ground.server.client, ground.store.bucket
    begun = datetime.now(UTC) - timedelta(seconds=1)
    for number in range(20):
        client.create_multipart_upload(Bucket=bucket, Key=f"{FLEET}/{ROBOT}/one/{number}")
    client.create_multipart_upload(Bucket=bucket, Key="another-fleet/r1/one/x")
    store, later = Store(ground.store), datetime.now(UTC) + timedelta(seconds=1)
    try:
        assert sweep(store, f"{FLEET}/", begun) == 0
        await asyncio.gather(*(asyncio.to_thread(sweep, store, f"{FLEET}/", later) for _ in range(2)))
    finally:
        store.close()
    left = client.list_multipart_uploads(Bucket=bucket)["Uploads"]
    assert [each["Key"] for each in left] == ["another-fleet/r1/one/x"]


async def test_young_uploads_hide_no_abandoned_one() -> None:
    class Listing:
        """A store with many uploads that run, and an abandoned one behind them."""

        def __init__(self) -> None:
            now = datetime.now(UTC)
            self.uploads = [OpenUpload(f"lab/r1/{number:05}", "u", now) for number in range(1500)]
            self.uploads.append(OpenUpload("lab/r2/one", "u", now - timedelta(days=9)))
            self.aborted: list[str] = []

        def open_uploads(self, _prefix: str) -> Iterator[OpenUpload]:
            yield from self.uploads

        def abort(self, upload: OpenUpload) -> None:
            self.aborted.append(upload.key)

    store: Any = Listing()
    assert sweep(store, f"{FLEET}/", datetime.now(UTC) - timedelta(days=7)) == 1
    assert store.aborted == ["lab/r2/one"]


async def test_metrics_and_health(ground: Ground) -> None:
    settings = ground.receivers[0]
    port = free_tcp_port()
    settings = settings.model_copy(update={"metrics": settings.metrics.model_copy(update={"port": port})})
    async with running_receiver(settings):
        await ask(ground.hub, "begin_upload", b"\xff")
        async with (
            aiohttp.ClientSession() as session,
            session.get(f"http://127.0.0.1:{port}/metrics") as answer,
        ):
            text = await answer.text()
        assert await asyncio.to_thread(state_of, f"unix:{settings.socket}", "receiver") == "SERVING"
    assert 'robot_receiver_requests_total{outcome="invalid",request="begin_upload"} 1.0' in text
    assert "robot_receiver_connected 1.0" in text


async def _until_last(hub: Hub, name: str, request: Message) -> AsyncIterator[bytes]:
    payloads: Any = hub.request_many(upload_subject(ROBOT, name), request.SerializeToString(), 20)
    async for payload in payloads:
        yield payload
        answer = pb.UploadResponse.FromString(payload)
        if answer.HasField("error") or answer.complete_upload.HasField("receipt"):
            return


@pytest.fixture
async def reader(secure: SecureHub, tmp_path: Path) -> AsyncIterator[Hub]:
    """A person's connection."""
    address = await asyncio.to_thread(
        secure.operator, f"reader{tmp_path.name}"[:60].replace("_", "-").strip("-")
    )
    async with connect(address) as hub:
        await hub.connected(20)
        yield hub


async def read_by(hub: Hub, request: pb.GetFilesRequest, name: str = "get_files") -> pb.UploadResponse:
    subject = reading_subject(ROBOT, name)
    return pb.UploadResponse.FromString(await hub.request(subject, request.SerializeToString(), 20))


async def test_people_get_urls_of_what_is_verified_and_of_nothing_else(ground: Ground, reader: Hub) -> None:
    wanted = pb.GetFilesRequest(recording_id="one", file_names=[FILE.name])
    async with receiving(ground) as receivers:
        assert (await read_by(reader, wanted)).error.code == pb.UPLOAD_ERROR_CODE_NOT_VERIFIED
        await uploaded(receivers)
        assert (await read_by(reader, wanted)).error.code == pb.UPLOAD_ERROR_CODE_NOT_VERIFIED
        await receivers.verify_file("one", FILE)
        (url,) = (await read_by(reader, wanted)).get_files.urls
        assert (url.file_name, url.expires_in_s) == (FILE.name, 900)
        async with aiohttp.ClientSession() as session, session.get(url.url) as answer:
            assert await answer.read() == DATA
        # The list of the whole recording is there once the whole is verified.
        entry = pb.GetFilesRequest(recording_id="one")
        assert (await read_by(reader, entry)).error.code == pb.UPLOAD_ERROR_CODE_NOT_VERIFIED
        for wrong in (
            pb.GetFilesRequest(recording_id="../r2/one", file_names=[FILE.name]),
            pb.GetFilesRequest(recording_id="one", file_names=["../two/data.bin"]),
            pb.GetFilesRequest(recording_id="one", file_names=[FILE.name] * 17),
        ):
            assert (await read_by(reader, wrong)).error.code == pb.UPLOAD_ERROR_CODE_INVALID


async def test_people_and_robots_have_requests_of_their_own(ground: Ground, reader: Hub) -> None:
    request = pb.GetFilesRequest(recording_id="one", file_names=[FILE.name])
    async with receiving(ground):
        assert (await ask(ground.hub, "get_files", request)).error.code == pb.UPLOAD_ERROR_CODE_INVALID
        for name in ("begin_file", "get_parts", "complete_upload"):
            assert (await read_by(reader, request, name)).error.code == pb.UPLOAD_ERROR_CODE_INVALID
