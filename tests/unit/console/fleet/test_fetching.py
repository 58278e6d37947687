"""URLs of receivers, and a recording as its receipt confirms it, with a hub in memory."""

import hashlib
from types import SimpleNamespace
from typing import Any

import pytest

from common.errors import UserError
from console.client.errors import GatewayFailed, Refused, Unreachable
from console.fleet.fetching import ReceiverUrls, read_verified, tls_context
from console.fleet.hub import recording_entries, recording_entry
from fleet.errors import HubError, HubReason
from fleet.receipt_keys import ReceiptSigner, digest_of, new_seed
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1.recording_pb2 import Recording, RecordingFile

SIGNER = ReceiptSigner(new_seed())
FILES = [RecordingFile(name="a", size=3, sha256=hashlib.sha256(b"abc").digest())]


class HubInMemory:
    """What a hub answers.

    Args:
        answer: To a request: a message, bytes, or an error.
        entries: Of the bucket of recordings.

    Attributes:
        subjects: Of requests, and which keys of the bucket were read.
    """

    def __init__(self, answer: Any = None, **entries: bytes) -> None:
        self._answer, self._entries = answer, entries
        self.subjects: list[str] = []

    async def request(self, subject: str, _payload: bytes, _timeout_s: float) -> bytes:
        self.subjects.append(subject)
        if isinstance(self._answer, Exception):
            raise self._answer
        return self._answer if isinstance(self._answer, bytes) else bytes(self._answer.SerializeToString())

    async def entries(self, _bucket: str, keys: str) -> dict[str, Any]:
        self.subjects.append(keys)
        return {
            (dotted := key.replace("_", ".")): SimpleNamespace(key=dotted, value=value)
            for key, value in self._entries.items()
        }


def urls_of(answer: Any) -> tuple[ReceiverUrls, HubInMemory]:
    hub: Any = HubInMemory(answer)
    return ReceiverUrls(hub, "r1", "one"), hub


def signed_url(name: str) -> pb.UploadResponse:
    return pb.UploadResponse(
        get_files=pb.GetFilesResponse(urls=[pb.FileUrl(file_name=name, url="https://store/a")])
    )


async def test_a_url_is_requested_once_and_again_when_it_is_no_good() -> None:
    urls, hub = urls_of(signed_url("a"))
    assert [await urls.url("a") for _ in range(3)] == ["https://store/a"] * 3
    urls.forget("a")
    urls.forget("b")
    await urls.url("a")
    assert hub.subjects == ["fleet.r1.get.get_files"] * 2


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (b"\xff\xff", GatewayFailed),
        (signed_url("b"), GatewayFailed),
        (pb.UploadResponse(), GatewayFailed),
        (pb.UploadResponse(error=pb.UploadError(code=pb.UPLOAD_ERROR_CODE_NOT_VERIFIED)), Refused),
        (pb.UploadResponse(error=pb.UploadError(code=pb.UPLOAD_ERROR_CODE_BUSY)), Unreachable),
        (HubError(HubReason.NO_RESPONDERS, "none"), Unreachable),
        (HubError(HubReason.REFUSED, "not permitted"), HubError),
    ],
)
async def test_other_answers_are_errors(answer: Any, error: type[Exception]) -> None:
    urls, _ = urls_of(answer)
    with pytest.raises(error) as caught:
        await urls.url("a")
    assert type(caught.value) is error


def stored(**changes: Any) -> pb.StoredRecording:
    recording = Recording(id="one", size=3, sha256=digest_of(FILES))
    receipt = pb.Receipt(fleet="lab", robot="r1", recording_id="one", size=3, sha256=recording.sha256)
    made = pb.StoredRecording(recording=recording, receipt=SIGNER.sign(receipt), files=FILES)
    made.MergeFrom(pb.StoredRecording(**changes))
    return made


async def read(entry: pb.StoredRecording | bytes, recording_id: str = "one") -> Any:
    hub: Any = HubInMemory(r1_one=entry if isinstance(entry, bytes) else entry.SerializeToString())
    keys = (SIGNER.public_key,)
    return await read_verified(hub, "lab", keys, robot="r1", recording_id=recording_id, tls=tls_context(None))


@pytest.mark.parametrize(("robot", "keys"), [("", ">"), ("r1", "r1.>")])
async def test_one_robots_recordings_alone_are_read(robot: str, keys: str) -> None:
    hub: Any = HubInMemory()
    await recording_entries(hub, robot)
    assert hub.subjects == [keys]


@pytest.mark.parametrize("robot", ["*", ">", "r1.*", "r1 x", "r1\r\nPUB x 1\r\nx", "R1", "x" * 64])
async def test_what_is_no_robots_name_never_becomes_a_subject(robot: str) -> None:
    hub: Any = HubInMemory()
    assert await recording_entries(hub, robot) == {}
    assert hub.subjects == []


async def test_one_recording_is_read_by_its_key_alone() -> None:
    hub: Any = HubInMemory(r1_one=stored().SerializeToString())
    entry = await recording_entry(hub, "r1", "one")
    assert entry is not None
    assert hub.subjects == ["r1.one"]


@pytest.mark.parametrize(
    ("robot", "recording_id"),
    [("*", "one"), ("r1", "*"), ("r1", ">"), ("r1", "one.two"), ("r1", ""), ("r1", "x" * 65), ("r1", "a b")],
)
async def test_what_is_no_recordings_key_never_becomes_a_subject(robot: str, recording_id: str) -> None:
    hub: Any = HubInMemory()
    assert await recording_entry(hub, robot, recording_id) is None
    assert hub.subjects == []


async def test_a_verified_recording_has_its_files_and_they_are_final() -> None:
    found = await read(stored())
    assert [(file.name, file.size, file.final) for file in found.files] == [("a", 3, True)]


@pytest.mark.parametrize(
    ("entry", "recording_id", "why"),
    [
        (stored(), "two", "the store has no recording two of r1"),
        (b"\xff\xff", "one", "unreadable"),
        (stored(recording=Recording(size=4)), "one", "its receipt is invalid"),
        (stored(files=[RecordingFile(name="b", sha256=b"s" * 32)]), "one", "not those that were verified"),
    ],
)
async def test_what_is_not_as_it_was_signed_is_not_copied(
    entry: pb.StoredRecording | bytes, recording_id: str, why: str
) -> None:
    with pytest.raises(UserError, match=why):
        await read(entry, recording_id)
