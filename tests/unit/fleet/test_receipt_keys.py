"""Receipts: what is signed, by whom, and for what."""

from pathlib import Path
from typing import Any

import pytest

from common.errors import UserError
from fleet.receipt_keys import (
    ReceiptError,
    as_text,
    confirmed,
    digest_of,
    new_seed,
    read_public_keys,
    read_signer,
)
from omniseer.fleet.v1.upload_pb2 import Receipt, SignedReceipt
from omniseer.gateway.v1.recording_pb2 import RecordingFile
from tests.support.uploading import new_signer

RECEIPT = Receipt(fleet="lab", robot="r1", recording_id="one", file_name="a", size=3, sha256=b"s" * 32)


def test_a_receipt_of_a_known_key_confirms_what_it_says() -> None:
    signer, other = new_signer(), new_signer()
    signed = signer.sign(Receipt(**_values(RECEIPT), verified_unix_ms=5, location="s3://b/k"))
    found = confirmed(signed, (other.public_key, signer.public_key), RECEIPT)
    assert found.location == "s3://b/k"
    with pytest.raises(ReceiptError, match=r"receipts\.pub does not have"):
        confirmed(signed, (other.public_key,), RECEIPT)
    with pytest.raises(ReceiptError, match="no receipt"):
        confirmed(SignedReceipt(), (signer.public_key,), RECEIPT)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("fleet", "other"),
        ("robot", "r2"),
        ("recording_id", "two"),
        ("file_name", ""),
        ("size", 4),
        ("sha256", b"t" * 32),
    ],
)
def test_a_receipt_for_something_else_confirms_nothing(name: str, value: object) -> None:
    signer = new_signer()
    signed = signer.sign(Receipt(**_values(RECEIPT) | {name: value}))
    with pytest.raises(ReceiptError, match=f"its {name} differs"):
        confirmed(signed, (signer.public_key,), RECEIPT)


def test_every_bit_of_a_receipt_is_signed() -> None:
    signer = new_signer()
    signed = signer.sign(RECEIPT)
    for field in ("receipt", "signature"):
        content = getattr(signed, field)
        for bit in range(8 * len(content)):
            changed = bytearray(content)
            changed[bit // 8] ^= 1 << bit % 8
            forged = SignedReceipt.FromString(signed.SerializeToString())
            setattr(forged, field, bytes(changed))
            with pytest.raises(ReceiptError):
                confirmed(forged, (signer.public_key,), RECEIPT)


def test_the_files_of_keys(tmp_path: Path) -> None:
    seed, other = new_seed(), new_signer()
    private, public = tmp_path / "receipts.key", tmp_path / "receipts.pub"
    private.write_text(as_text([seed]), encoding="ascii")
    signer = read_signer(private)
    public.write_text(as_text([other.public_key, signer.public_key]), encoding="ascii")
    assert read_public_keys(public) == (other.public_key, signer.public_key)
    assert confirmed(signer.sign(RECEIPT), read_public_keys(public), RECEIPT) == RECEIPT
    with pytest.raises(UserError, match="no key"):
        read_signer(public)


@pytest.mark.parametrize(
    "content", [b"", b"zz", b"ab" * 31, b"AB" * 32, b"-----BEGIN PUBLIC KEY-----", b"\xff"]
)
def test_files_with_something_else_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "receipts"
    path.write_bytes(content)
    for reading in (read_public_keys, read_signer):
        with pytest.raises(UserError, match="no key of receipts"):
            reading(path)
        with pytest.raises(UserError, match="can't be read"):
            reading(tmp_path / "none")


def test_the_sum_of_a_recording_is_in_the_order_of_names() -> None:
    files = [RecordingFile(name=name, sha256=name.encode() * 32) for name in ("b", "a")]
    assert digest_of(files) == digest_of(reversed(files))
    assert digest_of(files) != digest_of(files[:1])


def _values(receipt: Receipt) -> dict[str, Any]:
    return {field.name: value for field, value in receipt.ListFields()}
