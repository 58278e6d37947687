"""Receipts of recordings: signed by receivers, checked by robots (Ed25519, RFC 8032).

A robot has the public keys of its fleet's receivers from its enrolment. What a receipt says counts only when
one of them has signed it, and when it says what the robot expects.
"""

import hashlib
import re
from collections.abc import Iterable
from typing import Final

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from google.protobuf.message import DecodeError

from common.errors import UserError
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1.recording_pb2 import RecordingFile

_CONTEXT: Final = b"omniseer.fleet.v1.Receipt\0"
"""Before the signed bytes, so that no other signature of the key is one of a receipt."""
_KEY_ID_BYTES: Final = 8
_MOST_KEYS: Final = 64
_BLOCK: Final = re.compile(rb"-----BEGIN PUBLIC KEY-----[^-]{1,1024}-----END PUBLIC KEY-----")


class ReceiptError(Exception):
    """A receipt that confirms nothing; the text says why."""


class ReceiptSigner:
    """Signs receipts.

    Args:
        private_pem: An Ed25519 key, PKCS #8 in PEM.

    Raises:
        UserError: It is none.
    """

    def __init__(self, private_pem: bytes) -> None:
        try:
            key = serialization.load_pem_private_key(private_pem, password=None)
        except (ValueError, TypeError, UnsupportedAlgorithm) as error:
            raise UserError(
                "the signing key is not a private key in PEM", "Make one: robot-bridge hub init"
            ) from error
        if not isinstance(key, Ed25519PrivateKey):
            raise UserError("the signing key is not of the kind Ed25519", "Make one: robot-bridge hub init")
        self._key = key
        self._key_id = _key_id(key.public_key())

    @property
    def public_pem(self) -> bytes:
        """What robots check its receipts with."""
        return _pem(self._key.public_key())

    def sign(self, receipt: pb.Receipt) -> pb.SignedReceipt:
        """Returns the receipt with its signature."""
        content = receipt.SerializeToString(deterministic=True)
        signature = self._key.sign(_CONTEXT + content)
        return pb.SignedReceipt(receipt=content, signature=signature, key_id=self._key_id)


class ReceiptKeys:
    """The public keys of a fleet's receivers.

    Args:
        public_pems: One or more Ed25519 keys, one after the other in PEM: of `receipts.pub`.

    Raises:
        UserError: There is none, or one is of another kind.
    """

    def __init__(self, public_pems: bytes) -> None:
        keys = [_public_key(block) for block in _BLOCK.findall(public_pems)[:_MOST_KEYS]]
        if not keys:
            raise UserError(
                "receipts.pub has no public key", "Copy it again from the robot's enrolment (receipts.pub)"
            )
        self._keys = {_key_id(key): key for key in keys}

    def verified(self, signed: pb.SignedReceipt, expected: pb.Receipt) -> pb.Receipt:
        """Returns a receipt that one of the keys has signed and that confirms what is expected.

        Args:
            signed: From the hub, which may send anything.
            expected: With fleet, robot, recording_id, file_name, size and sha256.

        Raises:
            ReceiptError: It is not signed, or confirms something else.
        """
        key = self._keys.get(signed.key_id)
        if key is None:
            raise ReceiptError("the receipt is signed by a key that receipts.pub does not have")
        try:
            key.verify(signed.signature, _CONTEXT + signed.receipt)
            receipt = pb.Receipt.FromString(signed.receipt)
        except InvalidSignature:
            raise ReceiptError("the receipt's signature is wrong") from None
        except DecodeError as error:
            raise ReceiptError("the receipt can't be read") from error
        for name in ("fleet", "robot", "recording_id", "file_name", "size", "sha256"):
            if getattr(receipt, name) != getattr(expected, name):
                raise ReceiptError(f"the receipt is for something else: its {name} differs")
        return receipt


def new_signing_key() -> bytes:
    """Returns a new private key in PEM; `ReceiptSigner.public_pem` is its public one."""
    return Ed25519PrivateKey.generate().private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )


def digest_of(files: Iterable[RecordingFile]) -> bytes:
    """Returns the SHA-256 of a whole recording: as Recording.sha256, over its files in the order of names."""
    lines = (f"{file.sha256.hex()}  {file.name}\n" for file in sorted(files, key=lambda file: file.name))
    return hashlib.sha256("".join(lines).encode()).digest()


def _public_key(block: bytes) -> Ed25519PublicKey:
    try:
        key = serialization.load_pem_public_key(block)
    except (ValueError, UnsupportedAlgorithm) as error:
        raise UserError("receipts.pub has a damaged key", "Copy it again from the enrolment") from error
    if not isinstance(key, Ed25519PublicKey):
        raise UserError("receipts.pub has a key that is not Ed25519", "Copy it again from the enrolment")
    return key


def _key_id(key: Ed25519PublicKey) -> bytes:
    raw = key.public_bytes(serialization.Encoding.Raw, serialization.PublicFormat.Raw)
    return hashlib.sha256(raw).digest()[:_KEY_ID_BYTES]


def _pem(key: Ed25519PublicKey) -> bytes:
    return key.public_bytes(serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo)
