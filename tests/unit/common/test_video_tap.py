"""The records of the video tap, byte by byte."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.video_tap import (
    HEADER_BYTES,
    MAX_PAYLOAD_BYTES,
    Header,
    Kind,
    MalformedRecordError,
    decode_header,
    decode_object,
    encode_object,
)

BYTES = bytes.fromhex("52475631 03000000 00 01 0000 efcdab8967452301 00000000")
HEADER = Header(Kind.ACCESS_UNIT, 3, key_frame=True, captured_ns=0x0123456789ABCDEF)


def test_a_header_has_these_bytes() -> None:
    assert HEADER.encode() == BYTES
    assert len(BYTES) == HEADER_BYTES == 24


@given(st.sampled_from(Kind), st.integers(0, MAX_PAYLOAD_BYTES), st.booleans(), st.integers(0, (1 << 64) - 1))
def test_what_is_encoded_is_decoded(
    kind: Kind, length: int, key: bool, captured_ns: int
) -> None:  # hypothesis'
    header = Header(kind, length, key, captured_ns)
    assert decode_header(header.encode()) == header


def test_flags_of_later_versions_are_ignored() -> None:
    assert decode_header(BYTES[:9] + b"\xff" + BYTES[10:]) == HEADER


@pytest.mark.parametrize(
    ("encoded", "words"),
    [
        (BYTES[:-1], "23 bytes"),
        (b"RGV2" + BYTES[4:], "RGV2"),
        (BYTES[:4] + (MAX_PAYLOAD_BYTES + 1).to_bytes(4, "little") + BYTES[8:], "8388609 bytes"),
        (BYTES[:8] + b"\x03" + BYTES[9:], "kind 3"),
    ],
)
def test_what_is_no_header_is_refused(encoded: bytes, words: str) -> None:
    with pytest.raises(MalformedRecordError, match=words):
        decode_header(encoded)


@given(st.binary(min_size=HEADER_BYTES, max_size=HEADER_BYTES))
def test_any_other_bytes_are_a_header_or_refused(encoded: bytes) -> None:
    with suppress(MalformedRecordError):
        assert decode_header(encoded).length <= MAX_PAYLOAD_BYTES


def test_an_object_is_a_record() -> None:
    record = encode_object(Kind.GAP, {"frames": None, "from_ns": 1})
    header = decode_header(record[:HEADER_BYTES])
    assert (header.kind, header.length) == (Kind.GAP, len(record) - HEADER_BYTES)
    assert decode_object(record[HEADER_BYTES:]) == {"frames": None, "from_ns": 1}


@pytest.mark.parametrize("payload", [b"", b"{", b"[]", b"\xff", b"[" * 100_000, b"1"])
def test_what_is_no_object_is_refused(payload: bytes) -> None:
    with pytest.raises(MalformedRecordError):
        decode_object(payload)
