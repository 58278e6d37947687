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
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

from google.protobuf.message import DecodeError, Message

from fleet.names import LARGEST_MESSAGE, MOST_FILES
from fleet.receipt_keys import digest_of
from hub.receiver.keys import BadNameError, checked
from hub.receiver.store import (
    MOST_PARTS,
    PART_BYTES,
    URL_VALID_S,
    Store,
    StoredObject,
    StoreError,
    StoreProblem,
)
from hub.receiver.verified import Party, Records, Refusal, StoreCalls, Verified, not_verified
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1.recording_pb2 import Recording, RecordingFile

_log = logging.getLogger(__name__)

PROGRESS_S: Final = 2.0
_MOST_URLS: Final = 16
_LONGEST_ID: Final = 2048
_LONGEST_ETAG: Final = 128
_SHORTEST_S: Final = 600.0
_SLOWEST_BYTES_PER_S: Final = 1024 * 1024


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
        self._store = store
        self._call = StoreCalls(threads)
        self._verified = Verified(party, store, records, self._call)
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

    async def _begin_upload(self, robot: str, request: pb.BeginUploadRequest, _send: _Send) -> Message:
        recording = request.recording
        keys = self._verified.keys(robot, recording.id)
        if stored := await self._verified.recording(keys, recording):
            # The bucket may have lost it.
            await self._verified.enlist(keys, stored)
            return pb.BeginUploadResponse(receipt=stored.receipt)
        return pb.BeginUploadResponse()

    async def _begin_file(self, robot: str, request: pb.BeginFileRequest, _send: _Send) -> Message:
        file = _checked_file(request.file)
        keys = self._verified.keys(robot, request.recording_id)
        if receipt := await self._verified.file(keys, file):
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
        key = self._verified.keys(robot, request.recording_id).file(request.file_name)
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
        keys, names = self._verified.keys(robot, request.recording_id), request.file_names
        if len(names) > _MOST_URLS:
            raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, f"at most {_MOST_URLS} files at once")
        # An object and what shows that it is verified. The receipt itself is checked where the file is read.
        wanted = [(name, keys.file(name), keys.receipt(name)) for name in names]
        urls = []
        for name, key, proof in wanted or [("", keys.recording, keys.recording)]:
            if not await self._call(self._store.find, proof):
                raise not_verified(name or request.recording_id)
            url = await self._call(self._store.file_url, key)
            urls.append(pb.FileUrl(file_name=name, url=url, expires_in_s=URL_VALID_S))
        return pb.GetFilesResponse(urls=urls)

    async def _complete_file(self, robot: str, request: pb.CompleteFileRequest, _send: _Send) -> Message:
        keys = self._verified.keys(robot, request.recording_id)
        key = keys.file(request.file_name)
        parts = [(part.number, part.etag) for part in request.parts]
        if (
            [number for number, _ in parts] != list(range(1, len(parts) + 1))
            or not 0 < len(parts) <= MOST_PARTS
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
        keys = self._verified.keys(robot, request.recording_id)
        if receipt := await self._verified.file(keys, file):
            return pb.VerifyFileResponse(receipt=receipt)
        key = keys.file(file.name)
        found = await self._call(self._store.find, key)
        if found is None:
            raise Refusal(pb.UPLOAD_ERROR_CODE_NO_SUCH_UPLOAD, "the file is not in the store")
        if found.size != file.size or await self._digest(key, found, send) != file.sha256:
            await self._delete(key, found)
        receipt = self._verified.confirm(keys, file, self._store.location(key))
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
        keys = self._verified.keys(robot, recording.id)
        if not 0 < len(names) <= MOST_FILES:
            raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, f"a recording has 1 to {MOST_FILES} files")
        for name in names:
            checked(name)
        files: list[RecordingFile] = []
        task = asyncio.ensure_future(self._verified.read_receipts(keys, names, files))
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
        if missing := await self._verified.missing(keys, files):
            raise not_verified(missing)
        receipt = self._verified.confirm(keys, recording, self._store.location(keys.folder))
        plain = Recording.FromString(recording.SerializeToString())
        plain.ClearField("files")
        plain.ClearField("gaps")
        stored = pb.StoredRecording(recording=plain, receipt=receipt, files=files)
        await self._call(self._store.write, keys.recording, stored.SerializeToString())
        await self._verified.enlist(keys, stored)
        return pb.CompleteUploadResponse(receipt=receipt)


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
    if len(file.sha256) != 32 or _part_count(file.size) > MOST_PARTS:
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


def _changed() -> Refusal:
    return Refusal(pb.UPLOAD_ERROR_CODE_STORE, "the file has changed while it was read")
