import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.ros.list_truncation import truncate_list

LITTLE, BIG = b"\x00\x01\x00\x00", b"\x00\x00\x00\x00"


def message(encoding: bytes, frame: bytes, count: int, items: bytes) -> bytes:
    """A header and a list, as CDR writes them: the list's length on the next multiple of four."""
    order = "<" if encoding[1] % 2 else ">"
    header = struct.pack(f"{order}iII", 12, 34, len(frame) + 1) + frame + b"\x00"
    padding = b"\x00" * (-len(header) % 4)
    return encoding + header + padding + struct.pack(f"{order}I", count) + items


@given(
    encoding=st.sampled_from([LITTLE, BIG, b"\x00\x06\x00\x00", b"\x00\x07\x00\x00"]),
    frame=st.binary(max_size=40),
    count=st.integers(0, 2**32 - 1),
    max_items=st.integers(0, 1000),
    items=st.binary(max_size=40),
)
def test_only_the_length_of_the_list_changes(
    encoding: bytes, frame: bytes, count: int, max_items: int, items: bytes
) -> None:
    raw, truncated = truncate_list(message(encoding, frame, count, items), max_items)
    assert raw == message(encoding, frame, min(count, max_items), items)
    assert truncated == max(0, count - max_items)


@given(raw=st.binary(max_size=60), max_items=st.integers(0, 10))
def test_whatever_the_bytes_are_nothing_is_raised(raw: bytes, max_items: int) -> None:
    shorter, _ = truncate_list(raw, max_items)
    assert len(shorter) == len(raw)


@pytest.mark.parametrize("end", range(28))
def test_a_message_that_breaks_off_before_its_list_comes_back_as_it_is(end: int) -> None:
    raw = message(LITTLE, b"camera", 9, b"")[:end]
    assert truncate_list(raw, 2) == (raw, 0)


def test_another_encoding_is_left_alone() -> None:
    """Parameter lists, for example: where the list begins is not known there."""
    raw = message(b"\x00\x03\x00\x00", b"camera", 9, b"")
    assert truncate_list(raw, 2) == (raw, 0)
