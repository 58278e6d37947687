"""Key frames of another computer become small pictures, and nothing worse."""

import asyncio
import os
import time

import pytest

from common.trial import TrialError
from console.receiver import clips
from console.receiver.key_frame import HEIGHT_PX, MOST_BYTES, PICTURE_BYTES, WIDTH_PX, small_picture

pytestmark = pytest.mark.gst

CODECS = ("h264", "h265")


def pixel(picture: bytes, x: int, y: int) -> tuple[int, ...]:
    """Blue, green, red."""
    at = 4 * (y * WIDTH_PX + x)
    return tuple(picture[at : at + 3])


@pytest.mark.parametrize("codec", CODECS)
async def test_a_key_frame_becomes_a_small_picture_of_its_shape(codec: str) -> None:
    picture = await small_picture(clips.units(codec)[0], codec)
    assert len(picture) == PICTURE_BYTES
    shown = round(HEIGHT_PX * clips.WIDTH_PX / clips.HEIGHT_PX)
    left = (WIDTH_PX - shown) // 2
    bars = [sum(pixel(picture, left + shown * (2 * bar + 1) // 14, HEIGHT_PX // 4)) for bar in range(7)]
    assert bars[0] > 500, "the light bar"
    assert bars[6] < 400, "the dark one"
    if left > 2:
        assert max(pixel(picture, 1, HEIGHT_PX // 2)) < 40, "its border"


def broken(codec: str) -> dict[str, bytes]:
    unit = clips.units(codec)[0]
    return {
        "nothing": b"",
        "words": b"\0\0\0\1frame",
        "noise": os.urandom(1 << 20),
        "a start code and zeros": b"\0\0\0\1" + bytes(MOST_BYTES - 4),
        "half of it": unit[: len(unit) // 2],
        "too much": bytes(MOST_BYTES + 1),
    }


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("name", list(broken("h264")))
async def test_anything_else_is_an_error(codec: str, name: str) -> None:
    with pytest.raises(TrialError):
        await small_picture(broken(codec)[name], codec)


async def test_a_codec_is_one_of_two() -> None:
    with pytest.raises(TrialError, match="codec"):
        await small_picture(b"frame", "h264 ! filesink location=/tmp/x")


async def test_a_decoder_that_hangs_ends_at_the_deadline() -> None:
    began_s = time.monotonic()
    with pytest.raises(TrialError, match="hung"):
        await small_picture(clips.units("h264")[0], "h264", within_s=0.01)
    assert time.monotonic() - began_s < 3


async def test_cancelling_it_ends_the_child() -> None:
    task = asyncio.create_task(small_picture(clips.units("h264")[0], "h264"))
    await asyncio.sleep(0.05)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
