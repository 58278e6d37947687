"""Messages of image topics: what they show, and why others are refused."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.camera_tap import COMPRESSED, HALF_CHROMA, MAX_FRAME_BYTES, PACKED, frame_bytes
from tap.image import ENCODINGS, Frame, read_compressed, read_image
from tap.refusal import Reason, RefusedError
from tests.support.image_messages import BIG, LITTLE, compressed_image, image, jpeg_header, png


def pixels(frame: Frame) -> bytes:
    return b"".join(frame.pieces)


def reason_of(message: bytes, *, compressed: bool = False) -> Reason:
    with pytest.raises(RefusedError) as refused:
        (read_compressed if compressed else read_image)(message)
    return refused.value.reason


@pytest.mark.parametrize("order", [LITTLE, BIG])
@pytest.mark.parametrize("frame_id", ["", "a", "ab", "abc", "camera_link"])
def test_its_fields_are_found_in_either_byte_order_at_any_alignment(order: str, frame_id: str) -> None:
    data = bytes(range(24))
    frame = read_image(
        image("rgb8", 4, 2, 12, data, order=order, stamp_ns=1_700_000_000_123_456_789, frame_id=frame_id)
    )
    assert (frame.form, frame.width, frame.height, frame.size) == ("RGB", 4, 2, 24)
    assert frame.stamp_ns == 1_700_000_000_123_456_789
    assert pixels(frame) == data


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_every_encoding_has_a_form_whose_frames_are_whole(encoding: str) -> None:
    step = 8 * 4
    frame = read_image(image(encoding, 8, 4, step, bytes(step * 6)))
    assert frame.form in PACKED or frame.form in HALF_CHROMA
    assert frame.size == frame_bytes(frame.form, 8, 4) == len(pixels(frame))


def test_the_byte_order_of_the_pixels_is_not_that_of_the_message() -> None:
    data = bytes(8)
    assert read_image(image("mono16", 2, 2, 4, data, big_endian=0, order=BIG)).form == "GRAY16_LE"
    assert read_image(image("mono16", 2, 2, 4, data, big_endian=1, order=LITTLE)).form == "GRAY16_BE"


def test_rows_that_are_not_where_gstreamer_expects_them_are_moved() -> None:
    tight = read_image(image("mono8", 3, 2, 3, b"abcdef"))
    assert pixels(tight) == b"abc\0def\0"
    wide = read_image(image("mono8", 3, 2, 5, b"abc..def.."))
    assert pixels(wide) == b"abc\0def\0"
    # The padding of the last row may be missing.
    assert pixels(read_image(image("mono8", 3, 2, 5, b"abc..def"))) == b"abc\0def\0"


def test_what_follows_the_rows_is_left_out() -> None:
    assert pixels(read_image(image("mono8", 4, 1, 4, b"abcdefgh"))) == b"abcd"


def test_rows_that_fit_are_not_copied() -> None:
    frame = read_image(image("rgb8", 640, 480, 1920, bytes(1920 * 480)))
    assert [len(piece) for piece in frame.pieces] == [1920 * 480]


@pytest.mark.parametrize("step", [4, 6])
def test_both_ways_to_count_the_chroma_into_the_step_are_understood(step: int) -> None:
    data = b"yyyyYYYYuvuv"
    assert pixels(read_image(image("nv12", 4, 2, step, data))) == data


def test_a_second_plane_has_padded_rows_too() -> None:
    frame = read_image(image("nv21", 2, 2, 3, b"yy.YY.vu."))
    assert pixels(frame) == b"yy\0\0YY\0\0vu\0\0"


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (b"", Reason.MALFORMED),
        (b"\x00\x01", Reason.MALFORMED),
        (b"\x00\x06\x00\x00" + bytes(60), Reason.MALFORMED),
        (image("rgb8", 4, 2, 12, bytes(24))[:40], Reason.MALFORMED),
        (image("rgb8", 4, 2, 12, bytes(24), length=0xFFFFFFFF), Reason.MALFORMED),
        (image("x" * 5000, 4, 2, 12, bytes(24)), Reason.MALFORMED),
        (image("32FC1", 4, 2, 16, bytes(32)), Reason.ENCODING),
        (image("", 4, 2, 12, bytes(24)), Reason.ENCODING),
        (image("rgb8", 0, 2, 12, bytes(24)), Reason.SIZE),
        (image("rgb8", 4, 0, 12, bytes(24)), Reason.SIZE),
        (image("rgb8", 4_000_000_000, 4_000_000_000, 12, bytes(24)), Reason.SIZE),
        (image("rgba8", 8192, 8192, 32768, bytes(24)), Reason.SIZE),
        (image("nv12", 5, 2, 8, bytes(24)), Reason.SIZE),
        (image("nv12", 4, 3, 4, bytes(24)), Reason.SIZE),
        (image("yuyv", 3, 2, 6, bytes(24)), Reason.SIZE),
        (image("rgb8", 4, 2, 11, bytes(24)), Reason.STEP),
        (image("rgb8", 4, 2, 0, bytes(24)), Reason.STEP),
        (image("rgb8", 4, 2, 12, bytes(23)), Reason.DATA),
        (image("rgb8", 4, 2, 0xFFFFFFFF, bytes(24)), Reason.DATA),
        (image("rgb8", 4, 2, 12, b""), Reason.DATA),
        (image("nv12", 4, 2, 4, bytes(11)), Reason.DATA),
    ],
)
def test_what_can_not_be_shown_is_refused_with_its_reason(message: bytes, reason: Reason) -> None:
    assert reason_of(message) is reason


def test_the_text_of_a_refusal_is_short_whatever_was_sent() -> None:
    with pytest.raises(RefusedError) as refused:
        read_image(image("y" * 4000, 4, 2, 12, bytes(24)))
    assert len(refused.value.text) < 500


@given(st.binary(max_size=200))
def test_any_bytes_are_a_frame_or_refused(message: bytes) -> None:
    for read in (read_image, read_compressed):
        try:
            frame = read(message)
        except RefusedError:
            continue
        assert sum(map(len, frame.pieces)) == frame.size <= MAX_FRAME_BYTES


@given(
    st.sampled_from(ENCODINGS),
    st.integers(0, 70),
    st.integers(0, 70),
    st.integers(0, 300),
    st.integers(0, 20_000),
)
def test_a_frame_has_exactly_the_bytes_of_its_form(
    encoding: str, width: int, height: int, step: int, length: int
) -> None:
    try:
        frame = read_image(image(encoding, width, height, step, bytes(length)))
    except RefusedError:
        return
    assert sum(map(len, frame.pieces)) == frame.size == frame_bytes(frame.form, width, height)


def test_a_compressed_picture_is_measured_and_passed_on_as_it_is() -> None:
    thumbnail = b"\xff\xe1\x00\x20" + jpeg_header(16, 16)[:30]
    for content, form in (
        (jpeg_header(640, 480), "jpeg"),
        (jpeg_header(640, 480, before=b"\xff\xff" + thumbnail), "jpeg"),
        (png(640, 480), "png"),
    ):
        frame = read_compressed(compressed_image(content, "whatever; jpeg compressed bgr8", stamp_ns=5))
        assert (frame.form, frame.width, frame.height, frame.stamp_ns) == (form, 640, 480, 5)
        assert frame.form in COMPRESSED
        assert pixels(frame) == content


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", Reason.COMPRESSED),
        (b"GIF89a" + bytes(20), Reason.COMPRESSED),
        (b"\xff\xd8\xff", Reason.COMPRESSED),
        (jpeg_header(640, 480)[:-13], Reason.COMPRESSED),
        (b"\xff\xd8" + b"\xff\xe0\x00\x02" * 5000, Reason.COMPRESSED),
        (b"\xff\xd8\xff\xe0\x00\x00" + bytes(50), Reason.COMPRESSED),
        (b"\xff\xd8\xff\xda\x00\x08" + bytes(50), Reason.COMPRESSED),
        (b"\xff\xd8" + b"\xff" * 100_000, Reason.COMPRESSED),
        (png(16, 16)[:20], Reason.COMPRESSED),
        (jpeg_header(65500, 65500), Reason.SIZE),
        (jpeg_header(0, 480), Reason.SIZE),
        (png(8192, 8192, (0, 0, 0))[:100], Reason.SIZE),
    ],
)
def test_a_compressed_picture_that_no_decoder_is_to_get_is_refused(content: bytes, reason: Reason) -> None:
    assert reason_of(compressed_image(content), compressed=True) is reason


def test_a_picture_of_fill_bytes_is_given_up_at_once() -> None:
    """The defect: each was looked at, for seconds a picture, in which no other camera had the interpreter."""
    message = compressed_image(b"\xff\xd8" + b"\xff" * (MAX_FRAME_BYTES - 2))
    began_s = time.process_time()
    with pytest.raises(RefusedError, match="without a frame header"):
        read_compressed(message)
    assert time.process_time() - began_s < 0.5
