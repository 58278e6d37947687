"""What is verified: the receipts that count, in the store and in the hub's list of recordings."""

import asyncio
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final, ParamSpec, Protocol, TypeVar

from google.protobuf.message import DecodeError, Message

from fleet.errors import HubError, HubReason
from fleet.names import LARGEST_MESSAGE, MOST_FILES, RECORDINGS
from fleet.receipt_keys import ReceiptError, ReceiptSigner, confirmed
from hub.receiver.keys import RecordingKeys
from hub.receiver.store import CONNECTIONS, Store
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1.recording_pb2 import Recording, RecordingFile

_P = ParamSpec("_P")
_T = TypeVar("_T")
_M = TypeVar("_M", bound=Message)

THREADS: Final = CONNECTIONS
"""Calls of the store at once: each has a connection."""
_RECEIPT_BYTES: Final = 8192
_RECORD_BYTES: Final = 4 * 1024 * 1024
_MOST_IN_RECORD: Final = LARGEST_MESSAGE
"""Bytes of a StoredRecording in the hub's list; a larger one is listed without its files."""
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


def not_verified(name: str) -> Refusal:
    """Returns the refusal of a file, or of a recording, without a receipt that counts."""
    return Refusal(pb.UPLOAD_ERROR_CODE_NOT_VERIFIED, f"{name!a} is not verified")


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


class StoreCalls:
    """Calls the store, which blocks, in threads.

    Args:
        threads: At least THREADS.
    """

    def __init__(self, threads: ThreadPoolExecutor) -> None:
        self._threads = threads

    async def __call__(self, work: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Returns the result of a call of the store."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._threads, lambda: work(*args, **kwargs))


class Verified:
    """What a fleet's receivers have confirmed. Remembers nothing: what counts is in the store.

    Args:
        party: As whom it confirms.
        store: Where the bytes and the receipts are.
        records: Where recordings are listed.
        call: Calls the store.
    """

    def __init__(self, party: Party, store: Store, records: Records, call: StoreCalls) -> None:
        self._party, self._store, self._records, self._call = party, store, records, call

    def keys(self, robot: str, recording_id: str) -> RecordingKeys:
        """Returns where a recording is in the store.

        Raises:
            BadNameError: No recording has such an ID.
        """
        return RecordingKeys(self._party.fleet, robot, recording_id)

    async def file(self, keys: RecordingKeys, file: RecordingFile) -> pb.SignedReceipt | None:
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
        if self._counts(signed, self._receipt_of(keys, file)):
            return signed
        text = f"{file.name} was verified with other content before, which is kept"
        raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, text)

    async def recording(
        self, keys: RecordingKeys, expected: Recording | None = None
    ) -> pb.StoredRecording | None:
        """Returns a recording as the store has it, with a receipt that counts; None if it is not verified.

        Args:
            keys: Where it is.
            expected: The content that it is to have; None: any.
        """
        content = await self._call(self._store.read, keys.recording, _RECORD_BYTES)
        stored = _parsed(pb.StoredRecording, content) if content else None
        if stored is None or stored.recording.id != keys.recording_id:
            return None
        if not self._counts(stored.receipt, self._receipt_of(keys, expected or stored.recording)):
            return None
        return None if await self.missing(keys, stored.files) else stored

    async def list_again(self, robot: str, recording_id: str) -> bool:
        """Lists a recording of the store in the hub's bucket; returns whether it is verified.

        Raises:
            BadNameError: No recording has such an ID.
            StoreError: The store does not answer.
            Refusal: The hub has no place for it.
            HubError: The hub does not answer.
        """
        keys = self.keys(robot, recording_id)
        stored = await self.recording(keys)
        if stored:
            await self.enlist(keys, stored)
        return stored is not None

    async def read_receipts(
        self, keys: RecordingKeys, names: Sequence[str], files: list[RecordingFile]
    ) -> None:
        """Appends each file to `files` as its receipt has it.

        Raises:
            Refusal: One has no receipt that counts.
        """
        for begin in range(0, len(names), _AT_ONCE):
            some = names[begin : begin + _AT_ONCE]
            contents = await asyncio.gather(
                *(self._call(self._store.read, keys.receipt(name), _RECEIPT_BYTES) for name in some)
            )
            for name, content in zip(some, contents, strict=True):
                signed = _parsed(pb.SignedReceipt, content or b"")
                receipt = _parsed(pb.Receipt, signed.receipt if signed else b"")
                if not signed or not receipt:
                    raise not_verified(name)
                file = RecordingFile(name=name, size=receipt.size, sha256=receipt.sha256, final=True)
                if not self._counts(signed, self._receipt_of(keys, file)):
                    raise not_verified(name)
                files.append(file)

    async def missing(self, keys: RecordingKeys, files: Iterable[RecordingFile]) -> str:
        """Returns the name of a file that is not in the store with its size; empty if all are."""
        sizes = await self._call(self._store.sizes, f"{keys.folder}/", 2 * MOST_FILES)
        return next((file.name for file in files if sizes.get(keys.file(file.name)) != file.size), "")

    def confirm(
        self, keys: RecordingKeys, content: Recording | RecordingFile, location: str
    ) -> pb.SignedReceipt:
        """Returns a receipt: this content was read again, and is there."""
        receipt = self._receipt_of(keys, content)
        receipt.verified_unix_ms = time.time_ns() // 1_000_000
        receipt.location = location
        return self._party.signer.sign(receipt)

    async def enlist(self, keys: RecordingKeys, stored: pb.StoredRecording) -> None:
        """Lists a recording in the hub's bucket.

        Raises:
            Refusal: The hub has no place for it.
            HubError: The hub does not answer.
        """
        if stored.ByteSize() > _MOST_IN_RECORD:
            stored = pb.StoredRecording(recording=stored.recording, receipt=stored.receipt)
        try:
            key = f"{keys.robot}.{keys.recording_id}"
            await self._records.put(RECORDINGS, key, stored.SerializeToString())
        except HubError as error:
            if error.reason is HubReason.TOO_LARGE:
                text = "the description of the recording is too large for the hub"
                raise Refusal(pb.UPLOAD_ERROR_CODE_INVALID, text) from error
            if error.reason is HubReason.FULL:
                text = "the hub's list of recordings is full"
                raise Refusal(pb.UPLOAD_ERROR_CODE_STORE, text) from error
            raise

    def _counts(self, signed: pb.SignedReceipt, expected: pb.Receipt) -> bool:
        try:
            confirmed(signed, self._party.public_keys, expected)
        except ReceiptError:
            return False
        return True

    def _receipt_of(self, keys: RecordingKeys, content: Recording | RecordingFile) -> pb.Receipt:
        """Returns what is to be confirmed of a file, or of a recording."""
        return pb.Receipt(
            fleet=self._party.fleet,
            robot=keys.robot,
            recording_id=keys.recording_id,
            file_name=content.name if isinstance(content, RecordingFile) else "",
            size=content.size,
            sha256=content.sha256,
        )


def _parsed(kind: type[_M], content: bytes) -> _M | None:
    """Returns a message; None if it is none, or an empty one."""
    try:
        return kind.FromString(content) if content else None
    except DecodeError:
        return None
