"""Keys of receipts: receivers sign with one, and robots check with the public ones (Ed25519, RFC 8032).

| file | content |
|---|---|
| receipts.key | a private key, PKCS #8 in PEM; all receivers of a fleet may share it |
| receipts.pub | the public keys that count, in PEM; several, one after the other, while keys change |
"""

import hashlib
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key, load_pem_public_key

from common.errors import ExitCode, UserError
from fleet.receipts import PURPOSE, ReceiptFlaw, key_id, opened
from omniseer.fleet.v1.upload_pb2 import Receipt, SignedReceipt
from omniseer.gateway.v1.recording_pb2 import RecordingFile

_PUBLIC_KEY: Final = re.compile(rb"-----BEGIN PUBLIC KEY-----[^-]{1,1024}-----END PUBLIC KEY-----")
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
        key: Of a receiver.
    """

    def __init__(self, key: Ed25519PrivateKey) -> None:
        self._key = key

    @property
    def public_key(self) -> bytes:
        """What robots check its receipts with, 32 bytes."""
        return self._key.public_key().public_bytes_raw()

    def sign(self, receipt: Receipt) -> SignedReceipt:
        """Returns the receipt with its signature."""
        content = receipt.SerializeToString(deterministic=True)
        signature = self._key.sign(PURPOSE + content)
        return SignedReceipt(receipt=content, signature=signature, key_id=key_id(self.public_key))


def read_signer(path: Path) -> ReceiptSigner:
    """Returns what signs with the key of receipts.key.

    Raises:
        UserError: The file can't be read, or has something else.
    """
    try:
        key = load_pem_private_key(_content(path), password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise _wrong(path) from error
    if not isinstance(key, Ed25519PrivateKey):
        raise _wrong(path)
    return ReceiptSigner(key)


def read_public_keys(path: Path) -> tuple[bytes, ...]:
    """Returns the keys of receipts.pub, at least one, 32 bytes each.

    Raises:
        UserError: The file can't be read, or has something else.
    """
    blocks = _PUBLIC_KEY.findall(_content(path))
    if not 0 < len(blocks) <= _MOST_KEYS:
        raise _wrong(path)
    return tuple(_public_key(path, block) for block in blocks)


def confirmed(signed: SignedReceipt, public_keys: Sequence[bytes], expected: Receipt) -> Receipt:
    """Returns a receipt that one of the keys has signed and that confirms what is expected.

    Args:
        signed: From anyone.
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


def _content(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_LONGEST_FILE)
    except OSError as error:
        raise UserError(
            f"{path} can't be read: {error.strerror}", "Copy it again from the hub", exit_code=ExitCode.USAGE
        ) from error


def _public_key(path: Path, block: bytes) -> bytes:
    try:
        key = load_pem_public_key(block)
    except (ValueError, UnsupportedAlgorithm) as error:
        raise _wrong(path) from error
    if not isinstance(key, Ed25519PublicKey):
        raise _wrong(path)
    return key.public_bytes_raw()


def _wrong(path: Path) -> UserError:
    what = f"{path} has no key of receipts (Ed25519 in PEM)"
    return UserError(what, "Copy it again from the hub", exit_code=ExitCode.USAGE)
