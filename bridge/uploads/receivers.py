"""Requests to the fleet's receivers, and what is accepted as an answer.

Any receiver may answer any request, and a hostile hub may answer anything: what does not match the request,
or breaks a bound, is an error. What an answer says decides nothing but where to go on; see
fleet/receipt_keys.py for what makes a copy verified.
"""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Mapping, Sequence
from contextlib import aclosing
from typing import Any, Final, Protocol, cast

from google.protobuf.message import DecodeError, Message

from bridge.uploads.parts import LostError
from bridge.uploads.problems import AttemptError, CutError, RecordingError
from common.printable import printable
from fleet.errors import HubError, HubReason
from fleet.names import upload_subject
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1.recording_pb2 import Recording, RecordingFile

PART_BYTES: Final = 8 * 1024 * 1024
MOST_PARTS: Final = 10_000
"""Of a file (Amazon S3, multipart upload limits)."""
MOST_URLS: Final = 16
"""In one request."""
_LONGEST_ID: Final = 2048
_LONGEST_ETAG: Final = 128
_ANSWER_S: Final = 30.0
_SILENT_S: Final = 10.0
"""Of a receiver that reads a file: it reports every 2 s."""
_STILL_S: Final = 30.0
"""Longest time without progress of a receiver that reports."""
_ASKED: Final = 3
"""Times a silent receiver is asked: another one may answer."""
_SHORTEST_READING_S: Final = 120.0
_SLOWEST_BYTES_PER_S: Final = 1024 * 1024
"""Of a receiver that reads a file."""


class Requests(Protocol):
    """What uploads need of the connection to the hub (fleet.connection.Hub)."""

    async def request(self, subject: str, payload: bytes, timeout_s: float, /) -> bytes:
        """Returns the answer, or raises a `HubError`."""

    def request_many(self, subject: str, payload: bytes, silence_s: float, /) -> AsyncIterator[bytes]:
        """Yields the answers, or raises a `HubError`."""


class Receivers:
    """The receivers of a fleet, as seen from one robot. Every method raises an `AttemptError`.

    Args:
        hub: The connection.
        robot: The name under which it is enrolled.
    """

    def __init__(self, hub: Requests, robot: str) -> None:
        self._hub = hub
        self._robot = robot

    async def begin_upload(self, recording: Recording) -> pb.SignedReceipt | None:
        """Announces a recording; returns its receipt if the hub has it already."""
        answer = await self._request("begin_upload", pb.BeginUploadRequest(recording=recording))
        return answer.receipt if answer.HasField("receipt") else None

    async def begin_file(self, recording_id: str, file: RecordingFile) -> pb.BeginFileResponse:
        """Begins or resumes a file. The parts in the answer are within bounds and in order."""
        request = pb.BeginFileRequest(recording_id=recording_id, file=file)
        answer: pb.BeginFileResponse = await self._request("begin_file", request)
        numbers = [part.number for part in answer.parts]
        if (
            len(answer.upload_id) > _LONGEST_ID
            or (answer.upload_id and answer.part_size != PART_BYTES)
            or numbers != sorted(set(numbers))
            or (numbers and not 1 <= numbers[0] <= numbers[-1] <= part_count(file.size))
            or any(not 0 < len(part.etag) <= _LONGEST_ETAG for part in answer.parts)
        ):
            raise _senseless("begin_file")
        return answer

    async def part_urls(
        self, recording_id: str, file: RecordingFile, upload_id: str, numbers: Sequence[int]
    ) -> list[pb.PartUrl]:
        """Returns a URL for each part, in order."""
        request = pb.GetPartsRequest(
            recording_id=recording_id,
            file_name=file.name,
            upload_id=upload_id,
            numbers=numbers,
            file_size=file.size,
        )
        answer: pb.GetPartsResponse = await self._request("get_parts", request)
        if [each.number for each in answer.urls] != list(numbers):
            raise _senseless("get_parts")
        return list(answer.urls)

    async def complete_file(
        self, recording_id: str, file: RecordingFile, upload_id: str, etags: Sequence[str]
    ) -> None:
        """Requests that the parts are put together."""
        parts = [pb.Part(number=number, etag=etag) for number, etag in enumerate(etags, start=1)]
        request = pb.CompleteFileRequest(
            recording_id=recording_id, file_name=file.name, upload_id=upload_id, parts=parts
        )
        await self._request("complete_file", request)

    async def verify_file(self, recording_id: str, file: RecordingFile) -> pb.SignedReceipt:
        """Requests that a file is read again, and returns its receipt, which is still to be checked."""
        request = pb.VerifyFileRequest(recording_id=recording_id, file=file)
        limit_s = _SHORTEST_READING_S + file.size / _SLOWEST_BYTES_PER_S
        return await self._receipt("verify_file", request, lambda answer: answer.bytes_done, limit_s)

    async def complete_upload(self, recording: Recording, names: Sequence[str]) -> pb.SignedReceipt:
        """Requests the receipt of the whole recording; it is still to be checked."""
        request = pb.CompleteUploadRequest(recording=recording, file_names=names)
        limit_s = _SHORTEST_READING_S + len(names)
        return await self._receipt("complete_upload", request, lambda answer: answer.files_done, limit_s)

    async def _request(self, name: str, request: Message) -> Any:
        try:
            payload = await self._hub.request(
                upload_subject(self._robot, name), request.SerializeToString(), _ANSWER_S
            )
        except HubError as error:
            raise _hub_problem(error) from error
        return _answer(name, payload)

    async def _receipt(
        self, name: str, request: Message, progress: Callable[[Any], int], limit_s: float
    ) -> pb.SignedReceipt:
        """Sends a request that is answered by progress, then by a receipt."""
        try:
            async with asyncio.timeout(limit_s):
                for attempt in range(_ASKED):
                    try:
                        return await self._receipt_once(name, request, progress)
                    except HubError as error:
                        if error.reason is not HubReason.TIMEOUT or attempt == _ASKED - 1:
                            raise _hub_problem(error) from error
        except TimeoutError:
            pass
        raise CutError("the receiver has not finished reading in time")

    async def _receipt_once(
        self, name: str, request: Message, progress: Callable[[Any], int]
    ) -> pb.SignedReceipt:
        loop = asyncio.get_running_loop()
        reached, moved_s = -1, loop.time()
        subject = upload_subject(self._robot, name)
        payloads = self._hub.request_many(subject, request.SerializeToString(), _SILENT_S)
        async with aclosing(cast("AsyncGenerator[bytes]", payloads)):
            async for payload in payloads:
                answer = _answer(name, payload)
                if answer.HasField("receipt"):
                    receipt: pb.SignedReceipt = answer.receipt
                    return receipt
                if progress(answer) > reached:
                    reached, moved_s = progress(answer), loop.time()
                elif loop.time() - moved_s > _STILL_S:
                    break
        raise CutError("the receiver reports that it goes on, and does not")


def part_count(size: int) -> int:
    """Returns the number of parts of a file."""
    return -(-size // PART_BYTES)


def _answer(name: str, payload: bytes) -> Any:
    """Returns the answer to a request of that name.

    Raises:
        AttemptError, LostError: It is a refusal, or no answer to it.
    """
    try:
        response = pb.UploadResponse.FromString(payload)
    except DecodeError:
        raise _senseless(name) from None
    kind = response.WhichOneof("response")
    if kind == "error":
        raise _refusal(response.error)
    if kind != name:
        raise _senseless(name)
    return getattr(response, kind)


def _refusal(error: pb.UploadError) -> Exception:
    kind, text = _REFUSALS.get(error.code, (CutError, "the fleet's store does not answer: {}"))
    return kind(text.format(printable(error.message)[:200]))


_REFUSALS: Final[Mapping[int, tuple[type[Exception], str]]] = {
    pb.UPLOAD_ERROR_CODE_INVALID: (RecordingError, "the receiver refuses it: {}"),
    pb.UPLOAD_ERROR_CODE_NO_SUCH_UPLOAD: (LostError, "{}"),
    pb.UPLOAD_ERROR_CODE_WRONG_CONTENT: (
        RecordingError,
        "the store had other bytes than the robot's, and they were deleted",
    ),
    pb.UPLOAD_ERROR_CODE_NOT_VERIFIED: (RecordingError, "the hub has not verified all of its files: {}"),
    pb.UPLOAD_ERROR_CODE_NO_ROOM: (CutError, "the fleet's store has no room"),
    pb.UPLOAD_ERROR_CODE_BUSY: (CutError, "the fleet's receivers are busy"),
}


def _hub_problem(error: HubError) -> AttemptError:
    if error.reason is HubReason.TOO_LARGE:
        return RecordingError("its description with the names of its files is too large for the hub")
    if error.reason is HubReason.NO_RESPONDERS:
        return CutError("no receiver of recordings runs at the hub")
    return CutError(f"the hub can't be reached: {printable(str(error))[:200]}")


def _senseless(name: str) -> CutError:
    return CutError(f"the receiver's answer to {name} makes no sense")
