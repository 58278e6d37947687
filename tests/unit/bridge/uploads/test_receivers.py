"""Receivers that answer anything: nothing of it fills the memory, hangs the robot or verifies a copy."""

import asyncio
import hashlib
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from typing import Any

import pytest

from bridge.config import UploadSettings
from bridge.uploads.attempt import Attempt, Parties
from bridge.uploads.messages import recording_message
from bridge.uploads.parts import LostError, PartSender
from bridge.uploads.problems import AttemptError, CutError, RecordingError
from bridge.uploads.receivers import MOST_PARTS, PART_BYTES, Receivers
from console.client import results
from console.client.mapping.reader import read
from fleet.errors import HubError, HubReason
from fleet.names import MOST_FILES
from fleet.receipt_keys import ReceiptSigner
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1 import recording_pb2 as wire
from tests.support.filled import fill
from tests.support.uploading import Robot, new_signer
from tests.support.virtual_time import in_virtual_time

FILE = wire.RecordingFile(name="data.bin", size=20 * 1024 * 1024, sha256=b"s" * 32, final=True)


class Hub:
    """Answers as the test says."""

    def __init__(self, answer: Callable[[str, int], bytes | Exception]) -> None:
        self._answer = answer
        self.asked = 0

    async def request(self, subject: str, _payload: bytes, _timeout_s: float) -> bytes:
        return self._next(subject)

    async def request_many(self, subject: str, _payload: bytes, _silence_s: float) -> AsyncIterator[bytes]:
        while True:
            await asyncio.sleep(2)
            yield self._next(subject)

    def _next(self, subject: str) -> bytes:
        self.asked += 1
        found = self._answer(subject.rpartition(".")[2], self.asked)
        if isinstance(found, Exception):
            raise found
        return found


def response(**parts: Any) -> bytes:
    return pb.UploadResponse(**parts).SerializeToString()


def always(payload: bytes | Exception) -> Receivers:
    return Receivers(Hub(lambda _name, _asked: payload), "r1")


@pytest.mark.parametrize(
    "answer",
    [
        b"\xff\xff\xff",
        b"",
        response(get_parts=pb.GetPartsResponse()),
        response(begin_file=pb.BeginFileResponse(upload_id="u", part_size=1)),
        response(begin_file=pb.BeginFileResponse(upload_id="u" * 3000, part_size=PART_BYTES)),
        *(
            response(begin_file=pb.BeginFileResponse(upload_id="u", part_size=PART_BYTES, parts=parts))
            for parts in (
                [pb.Part(number=0, etag="e")],
                [pb.Part(number=4, etag="e")],
                [pb.Part(number=2**32 - 1, etag="e")],
                [pb.Part(number=1, etag="e"), pb.Part(number=1, etag="e")],
                [pb.Part(number=2, etag="e"), pb.Part(number=1, etag="e")],
                [pb.Part(number=1)],
                [pb.Part(number=1, etag="e" * 129)],
                [pb.Part(number=number, etag="e") for number in range(1, MOST_PARTS + 2)],
            )
        ),
    ],
)
async def test_answers_that_make_no_sense_are_errors(answer: bytes) -> None:
    with pytest.raises(CutError, match="makes no sense"):
        await always(answer).begin_file("one", FILE)


@pytest.mark.parametrize("numbers", [[], [1], [2, 1], [1, 2, 3], [1, 3]])
async def test_urls_of_other_parts_are_errors(numbers: list[int]) -> None:
    urls = [pb.PartUrl(number=number, url="https://store/x", expires_in_s=900) for number in numbers]
    with pytest.raises(CutError):
        await always(response(get_parts=pb.GetPartsResponse(urls=urls))).part_urls("one", FILE, "u", [1, 2])


@pytest.mark.parametrize("code", pb.UploadErrorCode.values())
async def test_every_code_of_a_refusal_has_a_meaning(code: Any) -> None:
    error = pb.UploadError(code=code, message="why\x1b[2J" + "x" * 10_000)
    with pytest.raises((AttemptError, LostError)) as caught:
        await always(response(error=error)).begin_file("one", FILE)
    assert len(str(caught.value)) < 400
    assert "\x1b" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "endless"),
    [
        ("still", lambda _asked: pb.VerifyFileResponse(bytes_done=1)),
        ("growing", lambda asked: pb.VerifyFileResponse(bytes_done=asked)),
        ("falling", lambda asked: pb.VerifyFileResponse(bytes_done=2**63 - asked)),
    ],
)
@in_virtual_time
async def test_endless_progress_ends(name: str, endless: Callable[[int], pb.VerifyFileResponse]) -> None:
    hub = Hub(lambda _name, asked: response(verify_file=endless(asked)))
    with pytest.raises(CutError, match=r"and does not|in time"):
        await Receivers(hub, "r1").verify_file("one", FILE)
    assert hub.asked < 200, name


@in_virtual_time
async def test_a_silent_receiver_is_asked_three_times() -> None:
    hub = Hub(lambda _name, _asked: HubError(HubReason.TIMEOUT, "silent"))
    with pytest.raises(CutError, match="can't be reached"):
        await Receivers(hub, "r1").verify_file("one", FILE)
    assert hub.asked == 3


async def test_forged_foreign_and_old_receipts_verify_nothing() -> None:
    robot = Robot()
    recording = robot.add("one", {"data.bin": b"data"})
    signer, other = new_signer(), new_signer()
    message = recording_message(recording)
    right = pb.Receipt(fleet="lab", robot="r1", recording_id="one", size=4, sha256=message.sha256)
    changed = {"robot": "r2", "fleet": "other", "recording_id": "two", "size": 5, "sha256": b"old" * 8}
    forgeries = [other.sign(right)]
    for field, value in changed.items():
        receipt = pb.Receipt.FromString(right.SerializeToString())
        setattr(receipt, field, value)
        forgeries.append(signer.sign(receipt))
    damaged = signer.sign(right)
    damaged.signature = bytes(64)
    for forged in (*forgeries, damaged, pb.SignedReceipt(receipt=b"x", signature=b"", key_id=b"")):
        answer = response(begin_upload=pb.BeginUploadResponse(receipt=forged))
        with pytest.raises(RecordingError, match="receipt"):
            await attempt(robot, always(answer), signer)
    answer = response(begin_upload=pb.BeginUploadResponse(receipt=signer.sign(right)))
    await attempt(robot, always(answer), signer)


async def attempt(robot: Robot, receivers: Receivers, signer: ReceiptSigner) -> None:
    async with PartSender(UploadSettings(store_hosts=("store.example",))) as sender:
        parties = Parties("lab", "r1", robot, receivers, sender, (signer.public_key,))
        await Attempt(parties, "one", begun=lambda *_: None, progress=lambda _: None, sent=lambda: None).run()


async def test_a_url_elsewhere_gets_nothing() -> None:
    robot = Robot()
    robot.add("one", {"data.bin": b"data"})
    answers = {
        "begin_upload": response(begin_upload=pb.BeginUploadResponse()),
        "begin_file": response(begin_file=pb.BeginFileResponse(upload_id="u", part_size=PART_BYTES)),
        "get_parts": response(
            get_parts=pb.GetPartsResponse(
                urls=[pb.PartUrl(number=1, url="https://192.168.0.1/admin", expires_in_s=900)]
            )
        ),
    }
    hub = Hub(lambda name, _asked: answers[name])
    with pytest.raises(CutError, match=r"192\.168\.0\.1, which is not in uploads\.store_hosts"):
        await attempt(robot, Receivers(hub, "r1"), new_signer())
    assert robot.opened == [], "nothing was even read"


async def test_what_can_t_be_uploaded_says_why() -> None:
    robot = Robot()
    good = robot.add("one", {"data.bin": b"data"})
    file = good.files[0]
    receivers = always(response(begin_upload=pb.BeginUploadResponse()))
    for changed, words in (
        ({"state": results.RecordingState.RECORDING}, "has not ended"),
        ({"files": ()}, "no files"),
        ({"files": (replace(file, final=False),)}, "not finished reading"),
        ({"sha256": b"x" * 32}, "list of its files is not whole"),
        ({"files": (file,) * (MOST_FILES + 1)}, "more files than the fleet's store takes"),
        ({"files": (replace(file, size=(MOST_PARTS + 1) * PART_BYTES),)}, "larger than 78 GiB"),
    ):
        robot.recordings["one"] = replace(good, **changed)
        with pytest.raises(RecordingError, match=words):
            await attempt(robot, receivers, new_signer())


def test_a_recording_reaches_the_hub_as_the_gateway_sent_it() -> None:
    message = wire.Recording()
    fill(message)
    for enumeration in ("kind", "state", "stop_reason"):
        setattr(message, enumeration, 2)
    sent = recording_message(read(results.Recording, message))
    for field in message.DESCRIPTOR.fields:
        if field.name in {"files", "gaps", "copy", "size", "sha256", "file_count"}:
            continue
        assert getattr(sent, field.name) == getattr(message, field.name), field.name
    assert (sent.size, sent.file_count) == (sum(file.size for file in message.files), len(message.files))
    lines = "".join(f"{file.sha256.hex()}  {file.name}\n" for file in message.files)
    assert sent.sha256 == hashlib.sha256(lines.encode()).digest()
