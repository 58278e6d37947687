"""Packets between the preview and the camera tap."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.camera_tap import (
    HEADER_BYTES,
    MAX_TEXT_BYTES,
    STATUS_REQUEST,
    Asked,
    Header,
    Kind,
    MalformedPacketError,
    decode,
    decode_request,
    decode_text,
    encode_examine,
    encode_text,
    encode_watch,
    is_topic,
)

FRAME = Header(Kind.FRAME, 640, 480, 640 * 480 * 3, 123_456_789_012, "RGB")


@pytest.mark.parametrize(
    "frame",
    [
        FRAME,
        Header(Kind.FRAME, 640, 480, 640 * 480 * 3 // 2, 1, "NV12"),
        Header(Kind.FRAME, 641, 480, 644 * 480, 1, "bayer-rggb"),
        Header(Kind.FRAME, 641, 480, 17, 1, "jpeg"),
    ],
)
def test_a_frame_is_read_as_it_was_written(frame: Header) -> None:
    assert decode(frame.encode()) == (frame, b"")
    assert len(frame.encode()) == HEADER_BYTES


@pytest.mark.parametrize(
    ("packet", "words"),
    [
        (b"", "0 bytes"),
        (FRAME.encode()[:-1], "47 bytes"),
        (b"RGV1" + FRAME.encode()[4:], "begins with"),
        (FRAME.encode()[:4] + b"\x07" + FRAME.encode()[5:], "kind 7"),
        (Header(Kind.FRAME, 640, 480, 640 * 480 * 3, 1, "I420").encode(), "form 'I420'"),
        (Header(Kind.FRAME, 640, 480, 640 * 480 * 3 - 1, 1, "RGB").encode(), "bytes for 640x480"),
        (Header(Kind.FRAME, 0, 480, 0, 1, "RGB").encode(), "0x480"),
        (Header(Kind.FRAME, 8193, 1, 8193 * 4, 1, "RGBA").encode(), "8193x1"),
        (Header(Kind.FRAME, 640, 480, 0, 1, "jpeg").encode(), "0 bytes"),
        (Header(Kind.FRAME, 640, 480, 1 << 40, 1, "jpeg").encode(), "bytes for"),
    ],
)
def test_what_is_no_packet_is_named(packet: bytes, words: str) -> None:
    with pytest.raises(MalformedPacketError, match=words):
        decode(packet)


@given(st.binary(max_size=100))
def test_any_bytes_are_a_packet_or_malformed(packet: bytes) -> None:
    for read in (decode, decode_request):
        try:
            read(packet)
        except MalformedPacketError:
            continue


def test_a_problem_is_one_printable_line_of_bounded_length() -> None:
    header, content = decode(encode_text(Kind.PROBLEM, "no\npicture \x1b[31m" + "ü" * 5000))
    assert header.kind is Kind.PROBLEM
    text = decode_text(content)
    assert text.startswith("no picture [31mü")
    assert len(text.encode()) <= MAX_TEXT_BYTES + 3
    assert text.isprintable()


@pytest.mark.parametrize("name", ["/image", "/front/image_raw", "/a/_b/c1"])
def test_a_full_name_is_a_topic(name: str) -> None:
    assert is_topic(name)
    assert decode_request(encode_watch(name)) == (Asked.FRAMES, name)
    assert decode_request(encode_examine(name)) == (Asked.PROBLEM, name)


@pytest.mark.parametrize(
    "name", ["", "/", "image", "/front/", "//x", "/1a", "/a b", "/a\n", "/ä", "/" + "x" * 255, "~/x", "/{x}"]
)
def test_anything_else_is_none(name: str) -> None:
    assert not is_topic(name)
    for encode in (encode_watch, encode_examine):
        with pytest.raises(MalformedPacketError):
            decode_request(encode(name))


def test_the_state_is_asked_for_by_name() -> None:
    assert decode_request(STATUS_REQUEST) == (Asked.STATE, "")


def test_an_older_tap_takes_the_question_for_a_topic_for_one_for_its_state() -> None:
    """It disconnects a client that sends what it does not know, and logs a warning."""
    assert json.loads(encode_examine("/image")).items() >= json.loads(STATUS_REQUEST).items()
