"""Receipts of recordings: whether a receiver of this fleet has signed that it has read these bytes."""

import hashlib
from collections.abc import Iterable
from enum import Enum
from typing import Final

from google.protobuf.message import DecodeError
from nacl.exceptions import BadSignatureError
from nacl.signing import VerifyKey

from omniseer.fleet.v1.upload_pb2 import Receipt, SignedReceipt

PURPOSE: Final = b"omniseer.fleet.v1.Receipt\0"
"""What a signature begins with (upload.proto): one for another purpose is none for this."""
_KEY_BYTES: Final = 32
_SIGNATURE_BYTES: Final = 64
_ID_BYTES: Final = 8


class ReceiptFlaw(Enum):
    """Why a receipt does not count."""

    MISSING = "missing"
    UNKNOWN_KEY = "unknown key"
    """None of the keys has signed it."""
    INVALID = "invalid"
    """Its signature does not belong to it, or what it says can't be read."""


def key_id(public_key: bytes) -> bytes:
    """Returns the short name of a public key in signed receipts."""
    return hashlib.sha256(public_key).digest()[:_ID_BYTES]


def opened(signed: SignedReceipt, public_keys: Iterable[bytes]) -> Receipt | ReceiptFlaw:
    """Returns what a receiver confirms, if the signature is that of one of the keys (RFC 8032 5.1.7).

    Args:
        signed: Of unknown origin.
        public_keys: Of the fleet's receivers, 32 bytes each.
    """
    if not signed.receipt:
        return ReceiptFlaw.MISSING
    known = {key_id(key): key for key in public_keys if len(key) == _KEY_BYTES}
    key = known.get(signed.key_id)
    if key is None:
        return ReceiptFlaw.UNKNOWN_KEY
    if len(signed.signature) != _SIGNATURE_BYTES:
        return ReceiptFlaw.INVALID
    try:
        VerifyKey(key).verify(PURPOSE + signed.receipt, signed.signature)
        return Receipt.FromString(signed.receipt)
    except (BadSignatureError, DecodeError):
        return ReceiptFlaw.INVALID
