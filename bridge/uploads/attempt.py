"""One attempt to upload a recording: what is missing is sent, then read again by a receiver, then confirmed.

Nothing of it is kept on the robot: where to go on is what the receivers say the store has, and what they say
is checked by the receipts alone. The bytes go from the gateway to the store as they come, one part after the
other: no part is ever in memory, and a cut costs at most one part.

| what happens | what follows |
|---|---|
| the gateway, the hub or the store fails | `CutError`; the next attempt goes on at the first missing part |
| a part's URL has expired | it is renewed, once for each part |
| the store has forgotten the multipart upload | the file is begun again, once in an attempt |
| the recording is deleted meanwhile | `GoneError` |
| a file is another one by now, or the robot's disk can't read it | `RecordingError` |
| the list of files is too long, or not that of the recording's SHA-256 | `RecordingError`; nothing is sent |
| the bytes in the store are wrong | deleted; `RecordingError`, and the next attempt sends them again |
| a receipt is forged, or for something else | `RecordingError`; never VERIFIED |
"""

import asyncio
from collections.abc import AsyncGenerator, Callable, Iterator, Sequence
from contextlib import aclosing, contextmanager
from dataclasses import dataclass
from typing import Final, Protocol

from bridge.uploads.messages import file_message, recording_message
from bridge.uploads.parts import ExpiredError, LostError, PartSender
from bridge.uploads.problems import CutError, GoneError, RecordingError
from bridge.uploads.receivers import MOST_PARTS, MOST_URLS, PART_BYTES, Receivers, part_count
from console.client import results
from console.client.errors import (
    Cancelled,
    DeadlineExceeded,
    GatewayError,
    GatewayFailed,
    NotAllowed,
    NotTrusted,
    Overloaded,
    Unreachable,
)
from fleet.names import MOST_FILES
from fleet.receipt_keys import ReceiptError, confirmed, digest_of
from omniseer.fleet.v1 import upload_pb2 as pb

_ENDED: Final = frozenset(
    {results.RecordingState.COMPLETE, results.RecordingState.RECOVERED, results.RecordingState.FAULTED}
)
_CUTS: Final = (Unreachable, DeadlineExceeded, Overloaded, NotAllowed, NotTrusted, Cancelled)
_REASONS_OF_CUTS: Final = frozenset({"RECORDER_UNREACHABLE", "TOO_MANY_EXPORTS", "RECORDING_NOT_CONFIGURED"})
_REASONS_GONE: Final = frozenset({"RECORDING_NOT_FOUND", "RECORDING_DELETED"})
_LEAST_VALIDITY_S: Final = 60.0
"""Of the URL of a part that is begun."""


class RecordingSource(Protocol):
    """What uploads need of the gateway (console.client.AsyncGatewayClient)."""

    async def recording(self, recording_id: str) -> results.Recording:
        """Returns a recording with its files."""

    def read_recording(
        self, recording_id: str, file: results.RecordingFile, offset: int = 0
    ) -> AsyncGenerator[bytes]:
        """Yields the bytes of a file."""


@dataclass(frozen=True, slots=True)
class Parties:
    """What an attempt is between.

    Attributes:
        fleet, robot: The names under which the robot is enrolled.
        source: Where the recordings are.
        receivers: Who confirms them.
        sender: Where they go.
        keys: Public ones of the receivers.
    """

    fleet: str
    robot: str
    source: RecordingSource
    receivers: Receivers
    sender: PartSender
    keys: tuple[bytes, ...]


class Attempt:
    """One attempt.

    Args:
        parties: What it is between.
        recording_id: Which.
        begun: Called once with the recording, with its size and sum.
        progress: Called with the bytes that the store has.
        sent: Called once the store has all.
    """

    def __init__(
        self,
        parties: Parties,
        recording_id: str,
        *,
        begun: Callable[[int, bytes], None],
        progress: Callable[[int], None],
        sent: Callable[[], None],
    ) -> None:
        self._parties = parties
        self._recording_id = recording_id
        self._begun, self._progress, self._sent = begun, progress, sent
        self._done = 0
        """Bytes of the files that the store has completely."""

    async def run(self) -> None:
        """Uploads the recording; it is verified when this returns.

        Raises:
            AttemptError: It is to be tried again.
            GoneError: There is no such recording.
        """
        try:
            await self._run()
        except LostError as error:
            raise RecordingError("the store has forgotten what was sent") from error

    async def _run(self) -> None:
        recording = await self._recording()
        message = recording_message(recording)
        self._begun(message.size, message.sha256)
        receivers = self._parties.receivers
        if receipt := await receivers.begin_upload(message):
            self._check(receipt, size=message.size, sha256=message.sha256)
            return
        unverified = [file for file in recording.files if not await self._send(file)]
        self._sent()
        for file in unverified:
            receipt = await receivers.verify_file(recording.id, file_message(file))
            self._check(receipt, file)
        names = sorted(file.name for file in recording.files)
        receipt = await receivers.complete_upload(message, names)
        self._check(receipt, size=message.size, sha256=message.sha256)

    async def _recording(self) -> results.Recording:
        """Returns the recording with its files, all of which are final."""
        with _gateway_problems():
            recording = await self._parties.source.recording(self._recording_id)
        if not ended(recording):
            raise RecordingError("the recording has not ended")
        if not all(file.final and len(file.sha256) == 32 for file in recording.files):
            raise RecordingError("the robot has not finished reading its files")
        if not recording.files:
            raise RecordingError("the recording has no files")
        if len(recording.files) > MOST_FILES:
            raise RecordingError(f"it has more files than the fleet's store takes, {MOST_FILES}: export it")
        if recording.sha256 and recording.sha256 != digest_of(map(file_message, recording.files)):
            raise RecordingError("the robot's list of its files is not whole, or has changed meanwhile")
        if any(part_count(file.size) > MOST_PARTS for file in recording.files):
            limit_gib = MOST_PARTS * PART_BYTES // 1024**3
            raise RecordingError(f"one of its files is larger than {limit_gib} GiB")
        return recording

    async def _send(self, file: results.RecordingFile) -> bool:
        """Sends what the store does not have of a file; returns whether the file is verified already."""
        try:
            verified = await self._send_once(file)
        except LostError:
            verified = await self._send_once(file)
        self._done += file.size
        self._progress(self._done)
        return verified

    async def _send_once(self, file: results.RecordingFile) -> bool:
        begun = await self._parties.receivers.begin_file(self._recording_id, file_message(file))
        if begun.HasField("receipt"):
            self._check(begun.receipt, file)
            return True
        if begun.upload_id:
            etags = {part.number: part.etag for part in begun.parts}
            await self._send_parts(file, begun.upload_id, etags)
            complete = [etags[number] for number in range(1, part_count(file.size) + 1)]
            await self._parties.receivers.complete_file(
                self._recording_id, file_message(file), begun.upload_id, complete
            )
        return False

    async def _send_parts(self, file: results.RecordingFile, upload_id: str, etags: dict[int, str]) -> None:
        """Sends the missing parts of a file, and adds their entity tags."""
        renewed = 0
        while numbers := _next_parts(file.size, etags):
            urls = await self._parties.receivers.part_urls(
                self._recording_id, file_message(file), upload_id, numbers
            )
            try:
                await self._send_run(file, urls, etags)
            except ExpiredError as error:
                refused = _next_parts(file.size, etags)[0]
                if refused == renewed:
                    raise CutError(f"the store refuses a part: {error or 'forbidden'}") from error
                renewed = refused

    async def _send_run(
        self, file: results.RecordingFile, urls: Sequence[pb.PartUrl], etags: dict[int, str]
    ) -> None:
        """Sends successive parts for as long as their URLs are valid, from one export."""
        loop = asyncio.get_running_loop()
        expire_s = loop.time() + urls[0].expires_in_s - _LEAST_VALIDITY_S
        offset = (urls[0].number - 1) * PART_BYTES
        async with aclosing(self._parties.source.read_recording(self._recording_id, file, offset)) as chunks:
            content = _Content(chunks)
            for index, url in enumerate(urls):
                if index and loop.time() > expire_s:
                    return
                self._progress(self._done + len(etags) * PART_BYTES)
                size = min(PART_BYTES, file.size - (url.number - 1) * PART_BYTES)
                try:
                    etags[url.number] = await self._parties.sender.put(url.url, size, content.take(size))
                except CutError as error:
                    with _gateway_problems():
                        raise content.error or error from None

    def _check(
        self,
        receipt: pb.SignedReceipt,
        file: results.RecordingFile | None = None,
        *,
        size: int = 0,
        sha256: bytes = b"",
    ) -> None:
        """Checks the receipt of a file, or of the recording."""
        expected = pb.Receipt(
            fleet=self._parties.fleet,
            robot=self._parties.robot,
            recording_id=self._recording_id,
            file_name=file.name if file else "",
            size=file.size if file else size,
            sha256=file.sha256 if file else sha256,
        )
        try:
            confirmed(receipt, self._parties.keys, expected)
        except ReceiptError as error:
            raise RecordingError(str(error)) from error


class _Content:
    """Cuts the chunks of an export into parts.

    Attributes:
        error: Why the export ended before its end.
    """

    def __init__(self, chunks: AsyncGenerator[bytes]) -> None:
        self._chunks = chunks
        self._rest = b""
        self.error: GatewayError | None = None

    async def take(self, size: int) -> AsyncGenerator[bytes]:
        """Yields the next bytes, so many in all."""
        while size > 0:
            try:
                data = self._rest or await anext(self._chunks)
            except StopAsyncIteration:
                self.error = GatewayFailed("the robot's export ended early")
                raise self.error from None
            except GatewayError as error:
                self.error = error
                raise
            piece, self._rest = data[:size], data[size:]
            size -= len(piece)
            yield piece


def ended(recording: results.Recording) -> bool:
    """Returns whether nothing is added to a recording any more."""
    return recording.state in _ENDED


def _next_parts(size: int, etags: dict[int, str]) -> list[int]:
    """Returns the first missing part and those missing directly after it, as many as get URLs at once."""
    missing = [number for number in range(1, part_count(size) + 1) if number not in etags]
    return [number for index, number in enumerate(missing[:MOST_URLS]) if number == missing[0] + index]


@contextmanager
def _gateway_problems() -> Iterator[None]:
    """Says for whom a gateway's error is a problem."""
    try:
        yield
    except GatewayError as error:
        if error.reason in _REASONS_GONE:
            raise GoneError from error
        if isinstance(error, _CUTS) or error.reason in _REASONS_OF_CUTS:
            raise CutError(f"the robot's gateway: {error.what}") from error
        raise RecordingError(error.what) from error
