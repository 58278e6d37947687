"""The stamp of the benchmarks: what is drawn is read, and nothing else is."""

import random
import time

import pytest

from bench.video import stamp

STRIDE = 1280
MIDDLE = stamp.BLOCK_PX // 2


def drawn(at_s: float) -> bytearray:
    luma = bytearray([90]) * (STRIDE * 32)
    stamp.draw(luma, STRIDE, at_s)
    return luma


def middle_row(luma: bytearray) -> bytes:
    return bytes(luma[MIDDLE * STRIDE : (MIDDLE + 1) * STRIDE])


@pytest.mark.parametrize("ago_s", [0.0, 0.05, 3.2, 60.0])
def test_what_is_drawn_is_read(ago_s: float) -> None:
    moment_s = time.monotonic() - ago_s
    read_s = stamp.read(middle_row(drawn(moment_s)))
    assert read_s == pytest.approx(moment_s, abs=stamp.TICK_S)


def test_the_moment_is_returned_as_it_is_read() -> None:
    luma = bytearray(STRIDE * stamp.BLOCK_PX)
    assert stamp.draw(luma, STRIDE, time.monotonic() - 1.0) == stamp.read(middle_row(luma))


def test_it_stays_in_its_corner() -> None:
    luma = drawn(time.monotonic())
    rows = [luma[start : start + STRIDE] for start in range(0, len(luma), STRIDE)]
    assert all(set(row[stamp.WIDTH_PX :]) == {90} for row in rows)
    assert all(set(row) == {90} for row in rows[stamp.BLOCK_PX :])


def test_coding_noise_does_not_matter() -> None:
    luck = random.Random(7)
    moment_s = time.monotonic()
    noisy = bytes(min(255, max(0, value + luck.randint(-60, 60))) for value in middle_row(drawn(moment_s)))
    assert stamp.read(noisy) == pytest.approx(moment_s, abs=stamp.TICK_S)


def test_a_torn_stamp_is_refused() -> None:
    row = bytearray(middle_row(drawn(time.monotonic())))
    for bit in range(stamp.BITS):
        torn = bytearray(row)
        block = slice(bit * stamp.BLOCK_PX, (bit + 1) * stamp.BLOCK_PX)
        torn[block] = bytes(255 - value for value in torn[block])
        assert stamp.read(bytes(torn)) is None


def test_a_picture_without_a_stamp_is_refused() -> None:
    assert stamp.read(bytes([90]) * STRIDE) is None
    assert stamp.read(bytes([235]) * STRIDE) is None
