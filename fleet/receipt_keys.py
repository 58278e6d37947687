"""Keys of receipts: receivers sign with one, and robots check with the public ones (Ed25519, RFC 8032).

| file | content |
|---|---|
| receipts.key | the seed of a key, 32 bytes in hexadecimal digits; all receivers of a fleet may share it |
| receipts.pub | the public keys that count, one a line in hexadecimal digits; several while keys change |
"""

import hashlib
import re
import secrets
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from nacl.signing import SigningKey

from common.errors import ExitCode, UserError
from fleet.receipts import PURPOSE, ReceiptFlaw, key_id, opened
from omniseer.fleet.v1.upload_pb2 import Receipt, SignedReceipt
from omniseer.gateway.v1.recording_pb2 import RecordingFile

_KEY_BYTES: Final = 32
_KEY: Final = re.compile(r"[0-9a-f]{64}")
_MOST_KEYS: Final = 64
_LONGEST_FILE: Final = 64 * 1024
_COMPARED: Final = ("fleet", "robot", "recording_id", "file_name", "size", "sha256")
_FLAWS: Final = {
    ReceiptFlaw.MISSING: "there is no receipt",
    ReceiptFlaw.UNKNOWN_KEY: "the receipt is signed by a key that receipts.pub does not have",
    ReceiptFlaw.INVALID: "the receipt's signature is wrong",
}


class ReceiptError(Exception):
    """A receipt that confirms nothing of what is expected; the text says why."""


class ReceiptSigner:
    """Signs receipts.

    Args:
        seed: Of the key, 32 bytes.
    """

    def __init__(self, seed: bytes) -> None:
        self._key = SigningKey(seed)

    @property
    def public_key(self) -> bytes:
        """What robots check its receipts with, 32 bytes."""
        return bytes(self._key.verify_key)

    def sign(self, receipt: Receipt) -> SignedReceipt:
        """Returns the receipt with its signature."""
        content = receipt.SerializeToString(deterministic=True)
        signature = self._key.sign(PURPOSE + content).signature
        return SignedReceipt(receipt=content, signature=signature, key_id=key_id(self.public_key))


def new_seed() -> bytes:
    """Returns the seed of a new key."""
    return secrets.token_bytes(_KEY_BYTES)


def as_text(keys: Iterable[bytes]) -> str:
    """Returns the content of receipts.key, or of receipts.pub."""
    return "".join(f"{key.hex()}\n" for key in keys)


def read_signer(path: Path) -> ReceiptSigner:
    """Returns what signs with the key of receipts.key.

    Raises:
        UserError: The file can't be read, or has something else.
    """
    return ReceiptSigner(_keys(path, most=1)[0])


def read_public_keys(path: Path) -> tuple[bytes, ...]:
    """Returns the keys of receipts.pub, at least one, 32 bytes each.

    Raises:
        UserError: The file can't be read, or has something else.
    """
    return _keys(path, _MOST_KEYS)


def confirmed(signed: SignedReceipt, public_keys: Sequence[bytes], expected: Receipt) -> Receipt:
    """Returns a receipt that one of the keys has signed and that confirms what is expected.

    Args:
        signed: Of unknown origin.
        public_keys: Of the fleet's receivers.
        expected: With fleet, robot, recording_id, file_name, size and sha256.

    Raises:
        ReceiptError: It is not signed, or confirms something else.
    """
    receipt = opened(signed, public_keys)
    if isinstance(receipt, ReceiptFlaw):
        raise ReceiptError(_FLAWS[receipt])
    for name in _COMPARED:
        if getattr(receipt, name) != getattr(expected, name):
            raise ReceiptError(f"the receipt is for something else: its {name} differs")
    return receipt


def digest_of(files: Iterable[RecordingFile]) -> bytes:
    """Returns the SHA-256 of a whole recording: as Recording.sha256, over its files in the order of names."""
    lines = (f"{file.sha256.hex()}  {file.name}\n" for file in sorted(files, key=lambda file: file.name))
    return hashlib.sha256("".join(lines).encode()).digest()


def _keys(path: Path, most: int) -> tuple[bytes, ...]:
    try:
        with path.open("rb") as file:
            lines = file.read(_LONGEST_FILE).decode("ascii").split()
    except OSError as error:
        raise UserError(
            f"{path} can't be read: {error.strerror}", "Copy it again from the hub", exit_code=ExitCode.USAGE
        ) from error
    except UnicodeDecodeError:
        lines = []
    if not 0 < len(lines) <= most or not all(map(_KEY.fullmatch, lines)):
        raise UserError(
            f"{path} has no key of receipts", "Copy it again from the hub", exit_code=ExitCode.USAGE
        )
    return tuple(map(bytes.fromhex, lines))
