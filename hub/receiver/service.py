"""Answers the requests of robots about uploads, and of people who read them.

Remembers nothing: any receiver may answer the next request.

| what happens | what follows |
|---|---|
| a request is repeated, or two receivers get the same one | the same answer: what counts is in the store |
| a robot asks for other content of a file that is verified | INVALID: what is verified is never overwritten |
| the bytes in the store are wrong | the object is deleted: WRONG_CONTENT, and the robot sends it again |
| the object changes while it is read | nothing is deleted or signed: STORE, and the robot asks again |
| a receiver stalls, and another one goes on | what it does then has the condition that nothing has changed |
| a verified file is not in the store any more | its receipt counts no more, and the robot sends it again |
| the store is full, refuses or does not answer | NO_ROOM or STORE, with the reason in words |
| the receiver ends while it reads | the robot asks again after 10 s, and another receiver answers |
| a name that could lead out of the recording's folder | INVALID |
| a person requests what is not verified | NOT_VERIFIED |
"""

import asyncio
import hashlib
import logging
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final, ParamSpec, Protocol, TypeVar

from google.protobuf.message import DecodeError, Message

from fleet.errors import HubError, HubReason
from fleet.names import LARGEST_MESSAGE, MOST_FILES, RECORDINGS
from fleet.receipt_keys import ReceiptError, ReceiptSigner, confirmed, digest_of
from hub.receiver.keys import BadNameError, RecordingKeys, checked
from hub.receiver.store import PART_BYTES, URL_VALID_S, Store, StoredObject, StoreError, StoreProblem
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1.recording_pb2 import Recording, RecordingFile

_log = logging.getLogger(__name__)
_P = ParamSpec("_P")
_T = TypeVar("_T")

THREADS: Final = 16
"""Calls of the store at once."""
PROGRESS_S: Final = 2.0
_MOST_URLS: Final = 16
_MOST_PARTS: Final = 10_000
_LONGEST_ID: Final = 2048
_LONGEST_ETAG: Final = 128
_RECEIPT_BYTES: Final = 8192
_RECORD_BYTES: Final = 4 * 1024 * 1024
_MOST_IN_RECORD: Final = LARGEST_MESSAGE
"""Of a StoredRecording in the bucket, in bytes; a larger one is listed without its files."""
_SHORTEST_S: Final = 600.0
_SLOWEST_BYTES_PER_S: Final = 1024 * 1024
_AT_ONCE: Final = 8
"""Receipts that are read at once."""


class Refusal(Exception):  # noqa: N818  # it is an answer
    """A request that is not carried out.

    Args:
        code: Why, for the robot.
        text: Why, for people.
    """

    def __init__(self, code: pb.UploadErrorCode.ValueType, text: str) -> None:
        super().__init__(text)
        self.code = code


class Records(Protocol):
    """Where verified recordings are listed (fleet.connection.Hub)."""

    async def put(self, bucket: str, key: str, value: bytes) -> None:
        """Sets a key, or raises a `HubError`."""


@dataclass(frozen=True, slots=True)
class Party:
    """As whom a receiver confirms.

    Attributes:
        fleet: Name of the fleet's account.
        signer: Signs its receipts.
        public_keys: Whose receipts count, its own among them.
    """

    fleet: str
    signer: ReceiptSigner
    public_keys: tuple[bytes, ...]


_Send = Callable[[Message], Awaitable[None]]
"""Sends a progress."""


class ReceiverService:
    """The requests by name.

    Args:
        party: As whom it confirms.
        store: Where the bytes are.
        records: Where recordings are listed.
        threads: For the store, at least THREADS.
    """

    def __init__(self, party: Party, store: Store, records: Records, threads: ThreadPoolExecutor) -> None:
        self._party, self._store, self._records, self._threads = party, store, records, threads
        self.bytes_read = 0
        """Bytes of recordings that were read again, since the start."""
        self._methods: Mapping[str, tuple[type[Any], Callable[..., Awaitable[Message]]]] = {
            "begin_upload": (pb.BeginUploadRequest, self._begin_upload),
            "begin_file": (pb.BeginFileRequest, self._begin_file),
            "get_parts": (pb.GetPartsRequest, self._get_parts),
            "complete_file": (pb.CompleteFileRequest, self._complete_file),
            "verify_file": (pb.VerifyFileRequest, self._verify_file),
            "complete_upload": (pb.CompleteUploadRequest, self._complete_upload),
        }
        self._methods_of_people: Mapping[str, tuple[type[Any], Callable[..., Awaitable[Message]]]] = {
            "get_files": (pb.GetFilesRequest, self._get_files),
        }

    async def answer(
        self,
        robot: str,
        name: str,
        payload: bytes,
        send: Callable[[pb.UploadResponse], Awaitable[None]],
        *,
        of_people: bool = False,
    ) -> str:
        """Answers one request.

        Args:
            robot: Of the request's subject.
            name: Of the request.
            payload: As sent.
            send: Sends an answer; the last one ends the request.
            of_people: Whether it is one of those that people may send, instead of robots.

        Returns:
            "ok", or the name of the code that it was refused with.
        """

        async def send_part(part: Message) -> None:
            response: Any = pb.UploadResponse()
            getattr(response, name).CopyFrom(part)
            if response.ByteSize() > LARGEST_MESSAGE:
                raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, "the answer is too large for the hub")
            await send(response)

        try:
            kind, method = _method(self._methods_of_people if of_people else self._methods, name)
            await send_part(await method(robot, kind.FromString(payload), send_part))
        except DecodeError:
            refusal = Refusal(pb.UPLOAD_ERROR_CODE_INVALID, "the request can't be read")
        except BadNameError as error:
            refusal = Refusal(pb.UPLOAD_ERROR_CODE_INVALID, str(error))
        except StoreError as error:
            refusal = Refusal(_CODES[error.problem], str(error))
        except TimeoutError:
            refusal = Refusal(pb.UPLOAD_ERROR_CODE_STORE, "the store is too slow")
        except Refusal as error:
            refusal = error
        else:
            return "ok"
        code = pb.UploadErrorCode.Name(refusal.code).removeprefix("UPLOAD_ERROR_CODE_")
        _log.info("%s of %s is refused with %s: %s", name, robot, code, refusal)
        await send(pb.UploadResponse(error=pb.UploadError(code=refusal.code, message=str(refusal))))
        return code.lower()

    async def list_again(self, robot: str, recording_id: str) -> bool:
        """Lists a recording of the store in the hub's bucket; returns whether it is verified.

        Raises:
            BadNameError: No recording has such an ID.
            StoreError: The store does not answer.
            Refusal: The hub has no place for it.
            HubError: The hub does not answer.
        """
        stored = await self._verified(robot, self._keys(robot, recording_id))
        if stored:
            await self._list(robot, stored)
        return stored is not None

    async def _begin_upload(self, robot: str, request: pb.BeginUploadRequest, _send: _Send) -> Message:
        recording = request.recording
        if stored := await self._verified(robot, self._keys(robot, recording.id), recording):
            # The bucket may have lost it.
            await self._list(robot, stored)
            return pb.BeginUploadResponse(receipt=stored.receipt)
        return pb.BeginUploadResponse()

    async def _begin_file(self, robot: str, request: pb.BeginFileRequest, _send: _Send) -> Message:
        file = _checked_file(request.file)
        keys = self._keys(robot, request.recording_id)
        if receipt := await self._receipt(robot, keys, file):
            return pb.BeginFileResponse(receipt=receipt)
        found = await self._call(self._store.find, keys.file(file.name))
        if file.size == 0:
            await self._call(self._store.create, keys.file(file.name))
        if file.size == 0 or (found and found.size == file.size):
            return pb.BeginFileResponse(part_size=PART_BYTES)
        upload_id = await self._call(self._store.open_upload, keys.file(file.name))
        parts = await self._call(self._store.parts, keys.file(file.name), upload_id)
        whole = [
            pb.Part(number=part.number, etag=part.etag)
            for part in parts
            if part.size == _part_size(file.size, part.number)
        ]
        return pb.BeginFileResponse(upload_id=upload_id, part_size=PART_BYTES, parts=whole)

    async def _get_parts(self, robot: str, request: pb.GetPartsRequest, _send: _Send) -> Message:
        key = self._keys(robot, request.recording_id).file(request.file_name)
        numbers, most = request.numbers, _part_count(request.file_size)
        if not 0 < len(numbers) <= _MOST_URLS or not all(0 < number <= most for number in numbers):
            raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, f"1 to {_MOST_URLS} parts of the file at once")
        _check_upload_id(request.upload_id)
        urls = [
            pb.PartUrl(
                number=number,
                url=await self._call(
                    self._store.part_url,
                    key,
                    request.upload_id,
                    number,
                    _part_size(request.file_size, number),
                ),
                expires_in_s=URL_VALID_S,
            )
            for number in numbers
        ]
        return pb.GetPartsResponse(urls=urls)

    async def _get_files(self, robot: str, request: pb.GetFilesRequest, _send: _Send) -> Message:
        keys, names = self._keys(robot, request.recording_id), request.file_names
        if len(names) > _MOST_URLS:
            raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, f"at most {_MOST_URLS} files at once")
        # An object and what shows that it is verified. The receipt itself is checked where the file is read.
        wanted = [(name, keys.file(name), keys.receipt(name)) for name in names]
        urls = []
        for name, key, proof in wanted or [("", keys.recording, keys.recording)]:
            if not await self._call(self._store.find, proof):
                raise _not_verified(name or request.recording_id)
            url = await self._call(self._store.file_url, key)
            urls.append(pb.FileUrl(file_name=name, url=url, expires_in_s=URL_VALID_S))
        return pb.GetFilesResponse(urls=urls)

    async def _complete_file(self, robot: str, request: pb.CompleteFileRequest, _send: _Send) -> Message:
        keys = self._keys(robot, request.recording_id)
        key = keys.file(request.file_name)
        parts = [(part.number, part.etag) for part in request.parts]
        if (
            [number for number, _ in parts] != list(range(1, len(parts) + 1))
            or not 0 < len(parts) <= _MOST_PARTS
            or not all(0 < len(etag) <= _LONGEST_ETAG for _, etag in parts)
        ):
            raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, "the parts are not those of one file, in order")
        _check_upload_id(request.upload_id)
        # What is there was completed before, and may be verified since: only a look at its bytes replaces it.
        if not await self._call(self._store.find, key):
            try:
                await self._call(self._store.complete, key, request.upload_id, parts)
            except StoreError as error:
                repeated = error.problem in {StoreProblem.MISSING, StoreProblem.CHANGED}
                if not repeated or not await self._call(self._store.find, key):
                    raise
        return pb.CompleteFileResponse()

    async def _verify_file(self, robot: str, request: pb.VerifyFileRequest, send: _Send) -> Message:
        file = _checked_file(request.file)
        keys = self._keys(robot, request.recording_id)
        if receipt := await self._receipt(robot, keys, file):
            return pb.VerifyFileResponse(receipt=receipt)
        key = keys.file(file.name)
        found = await self._call(self._store.find, key)
        if found is None:
            raise Refusal(pb.UPLOAD_ERROR_CODE_NO_SUCH_UPLOAD, "the file is not in the store")
        if found.size != file.size or await self._digest(key, found, send) != file.sha256:
            await self._delete(key, found)
        expected = self._receipt_of(robot, Recording(id=request.recording_id), file)
        receipt = self._sign(expected, self._store.location(key))
        await self._call(self._store.write, keys.receipt(file.name), receipt.SerializeToString())
        if await self._call(self._store.find, key) != found:
            await self._forget(keys.receipt(file.name))
            raise _changed()
        return pb.VerifyFileResponse(receipt=receipt)

    async def _digest(self, key: str, found: StoredObject, send: _Send) -> bytes:
        """Returns the SHA-256 of an object; reports how far it has come."""
        digest, done, stopped = hashlib.sha256(), 0, threading.Event()

        def read() -> None:
            nonlocal done
            for data in self._store.stream(key, found.etag):
                if stopped.is_set():
                    return
                digest.update(data)
                done += len(data)

        task = asyncio.ensure_future(self._call(read))
        try:
            async with asyncio.timeout(_SHORTEST_S + found.size / _SLOWEST_BYTES_PER_S):
                async for _ in _every(PROGRESS_S, task):
                    await send(pb.VerifyFileResponse(bytes_done=done))
            await task
        finally:
            stopped.set()
            task.cancel()
        self.bytes_read += done
        return digest.digest()

    async def _delete(self, key: str, found: StoredObject) -> None:
        """Deletes an object whose content is wrong.

        Raises:
            Refusal: Always: to the robot.
        """
        if await self._call(self._store.find, key) != found:
            raise _changed()
        try:
            await self._call(self._store.delete, key, found.etag)
        except StoreError as error:
            if error.problem is StoreProblem.CHANGED:
                raise _changed() from error
            raise
        text = "the bytes in the store are not the robot's; they were deleted"
        raise Refusal(pb.UPLOAD_ERROR_CODE_WRONG_CONTENT, text)

    async def _forget(self, key: str) -> None:
        """Deletes a receipt."""
        if receipt := await self._call(self._store.find, key):
            await self._call(self._store.delete, key, receipt.etag)

    async def _complete_upload(self, robot: str, request: pb.CompleteUploadRequest, send: _Send) -> Message:
        recording, names = request.recording, sorted(set(request.file_names))
        keys = self._keys(robot, recording.id)
        if not 0 < len(names) <= MOST_FILES:
            raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, f"a recording has 1 to {MOST_FILES} files")
        for name in names:
            checked(name)
        files: list[RecordingFile] = []
        task = asyncio.ensure_future(self._read_receipts(robot, keys, names, files))
        try:
            async with asyncio.timeout(_SHORTEST_S + len(names)):
                async for _ in _every(PROGRESS_S, task):
                    await send(pb.CompleteUploadResponse(files_done=len(files)))
            await task
        finally:
            task.cancel()
        size = sum(file.size for file in files)
        if digest_of(files) != recording.sha256 or size != recording.size:
            text = "the files that are verified are not those of the recording"
            raise Refusal(pb.UPLOAD_ERROR_CODE_NOT_VERIFIED, text)
        if missing := await self._missing(keys, files):
            raise _not_verified(missing)
        location = self._store.location(keys.folder)
        receipt = self._sign(self._receipt_of(robot, recording), location)
        plain = Recording.FromString(recording.SerializeToString())
        plain.ClearField("files")
        plain.ClearField("gaps")
        stored = pb.StoredRecording(recording=plain, receipt=receipt, files=files)
        await self._call(self._store.write, keys.recording, stored.SerializeToString())
        await self._list(robot, stored)
        return pb.CompleteUploadResponse(receipt=receipt)

    async def _read_receipts(
        self, robot: str, keys: RecordingKeys, names: list[str], files: list[RecordingFile]
    ) -> None:
        """Adds each file that has a receipt."""
        for begin in range(0, len(names), _AT_ONCE):
            some = names[begin : begin + _AT_ONCE]
            contents = await asyncio.gather(
                *(self._call(self._store.read, keys.receipt(name), _RECEIPT_BYTES) for name in some)
            )
            for name, content in zip(some, contents, strict=True):
                signed = _parsed(pb.SignedReceipt, content or b"")
                receipt = _parsed(pb.Receipt, signed.receipt if signed else b"")
                if not signed or not receipt:
                    raise _not_verified(name)
                file = RecordingFile(name=name, size=receipt.size, sha256=receipt.sha256, final=True)
                if not self._counts(signed, self._receipt_of(robot, Recording(id=keys.recording_id), file)):
                    raise _not_verified(name)
                files.append(file)

    async def _missing(self, keys: RecordingKeys, files: Iterable[RecordingFile]) -> str:
        """Returns the name of a file that is not in the store with its size; empty if all are."""
        sizes = await self._call(self._store.sizes, f"{keys.folder}/", 2 * MOST_FILES)
        return next((file.name for file in files if sizes.get(keys.file(file.name)) != file.size), "")

    async def _verified(
        self, robot: str, keys: RecordingKeys, recording: Recording | None = None
    ) -> pb.StoredRecording | None:
        """Returns a recording as the store has it, with a receipt that counts; None if it is not verified.

        Args:
            robot: Whose it is.
            keys: Where it is.
            recording: The content that it is to have; None: any.
        """
        content = await self._call(self._store.read, keys.recording, _RECORD_BYTES)
        stored = _parsed(pb.StoredRecording, content) if content else None
        if stored is None or stored.recording.id != keys.recording_id:
            return None
        if not self._counts(stored.receipt, self._receipt_of(robot, recording or stored.recording)):
            return None
        return None if await self._missing(keys, stored.files) else stored

    async def _receipt(self, robot: str, keys: RecordingKeys, file: RecordingFile) -> pb.SignedReceipt | None:
        """Returns the receipt of a file that is in the store, if there is one.

        Raises:
            Refusal: There is one, of other content.
        """
        content = await self._call(self._store.read, keys.receipt(file.name), _RECEIPT_BYTES)
        signed = _parsed(pb.SignedReceipt, content) if content else None
        verified = _parsed(pb.Receipt, signed.receipt) if signed else None
        if not signed or not verified or not self._counts(signed, verified):
            return None
        found = await self._call(self._store.find, keys.file(file.name))
        if found is None or found.size != verified.size:
            return None
        if self._counts(signed, self._receipt_of(robot, Recording(id=keys.recording_id), file)):
            return signed
        text = f"{file.name} was verified with other content before, which is kept"
        raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, text)

    def _counts(self, signed: pb.SignedReceipt, expected: pb.Receipt) -> bool:
        try:
            confirmed(signed, self._party.public_keys, expected)
        except ReceiptError:
            return False
        return True

    def _receipt_of(self, robot: str, recording: Recording, file: RecordingFile | None = None) -> pb.Receipt:
        """Returns what is to be confirmed of a file, or of a recording."""
        return pb.Receipt(
            fleet=self._party.fleet,
            robot=robot,
            recording_id=recording.id,
            file_name=file.name if file else "",
            size=file.size if file else recording.size,
            sha256=file.sha256 if file else recording.sha256,
        )

    def _sign(self, receipt: pb.Receipt, location: str) -> pb.SignedReceipt:
        receipt.verified_unix_ms = time.time_ns() // 1_000_000
        receipt.location = location
        return self._party.signer.sign(receipt)

    async def _list(self, robot: str, stored: pb.StoredRecording) -> None:
        """Lists a recording in the hub's bucket.

        Raises:
            Refusal: The hub has no place for it.
            HubError: The hub does not answer.
        """
        if stored.ByteSize() > _MOST_IN_RECORD:
            stored = pb.StoredRecording(recording=stored.recording, receipt=stored.receipt)
        try:
            await self._records.put(RECORDINGS, f"{robot}.{stored.recording.id}", stored.SerializeToString())
        except HubError as error:
            if error.reason is HubReason.TOO_LARGE:
                text = "the description of the recording is too large for the hub"
                raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, text) from error
            if error.reason is HubReason.FULL:
                text = "the hub's list of recordings is full"
                raise Refusal(pb.UPLOAD_ERROR_CODE_STORE, text) from error
            raise

    def _keys(self, robot: str, recording_id: str) -> RecordingKeys:
        return RecordingKeys(self._party.fleet, robot, recording_id)

    async def _call(self, work: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Returns the result of a call of the store."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._threads, lambda: work(*args, **kwargs))


_CODES: Final = {
    StoreProblem.NO_ROOM: pb.UPLOAD_ERROR_CODE_NO_ROOM,
    StoreProblem.MISSING: pb.UPLOAD_ERROR_CODE_NO_SUCH_UPLOAD,
    StoreProblem.CHANGED: pb.UPLOAD_ERROR_CODE_STORE,
    StoreProblem.REFUSED: pb.UPLOAD_ERROR_CODE_STORE,
}


def busy() -> bytes:
    """Returns the answer to requests beyond those that a receiver may have in hand."""
    error = pb.UploadError(code=pb.UPLOAD_ERROR_CODE_BUSY, message="the receiver has enough in hand")
    return pb.UploadResponse(error=error).SerializeToString()


async def _every(period_s: float, task: "asyncio.Future[None]") -> AsyncIterator[None]:
    """Yields at once and then every so often, until the task is done."""
    while not task.done():
        yield
        await asyncio.wait({task}, timeout=period_s)


def _method(
    methods: Mapping[str, tuple[type[Any], Callable[..., Awaitable[Message]]]], name: str
) -> tuple[type[Any], Callable[..., Awaitable[Message]]]:
    found = methods.get(name)
    if found is None:
        raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, "there is no such request")
    return found


def _checked_file(file: RecordingFile) -> RecordingFile:
    checked(file.name)
    if len(file.sha256) != 32 or _part_count(file.size) > _MOST_PARTS:
        raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, "the file is too large, or has no SHA-256")
    return file


def _check_upload_id(upload_id: str) -> None:
    if not 0 < len(upload_id) <= _LONGEST_ID or not upload_id.isascii() or not upload_id.isprintable():
        raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, "that is no upload's ID")


def _part_count(size: int) -> int:
    return -(-size // PART_BYTES)


def _part_size(size: int, number: int) -> int:
    """Returns the size of a part of a file."""
    return min(PART_BYTES, size - (number - 1) * PART_BYTES)


def _not_verified(name: str) -> Refusal:
    return Refusal(pb.UPLOAD_ERROR_CODE_NOT_VERIFIED, f"{name!a} is not verified")


def _changed() -> Refusal:
    return Refusal(pb.UPLOAD_ERROR_CODE_STORE, "the file has changed while it was read")


_M = TypeVar("_M", bound=Message)


def _parsed(kind: type[_M], content: bytes) -> _M | None:
    """Returns a message; None if it is none, or an empty one."""
    try:
        return kind.FromString(content) if content else None
    except DecodeError:
        return None
