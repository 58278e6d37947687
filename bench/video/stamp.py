"""Capture time, drawn into the frame itself, so that it survives every step up to the decoder.

A number of 32 bits in blocks of 16 x 16 pixels, black or white, in the top left corner, then 8 check bits.
The number counts ticks of 0.1 ms on `time.monotonic()`, which all processes of a machine share. Blocks of
that size come through any bit rate that shows a frame at all.
"""

import time
from typing import Final

TICK_S: Final = 1e-4
BLOCK_PX: Final = 16
_VALUE_BITS: Final = 32
_CHECK_BITS: Final = 8
BITS: Final = _VALUE_BITS + _CHECK_BITS
WIDTH_PX: Final = BITS * BLOCK_PX
_BLACK: Final = bytes([16]) * BLOCK_PX
_WHITE: Final = bytes([235]) * BLOCK_PX
_MIDDLE: Final = 126


def draw(luma: bytearray, stride: int, at_s: float) -> float:
    """Draws a moment into a plane of luma.

    Args:
        luma: the plane, at least `BLOCK_PX` rows of it.
        stride: bytes from one row to the next, at least `WIDTH_PX`.
        at_s: the moment, on `time.monotonic()`.

    Returns:
        The moment as `read` returns it, rounded to ticks.
    """
    ticks = round(at_s / TICK_S)
    value = ticks % (1 << _VALUE_BITS)
    code = value << _CHECK_BITS | _check(value)
    row = b"".join(_WHITE if code >> bit & 1 else _BLACK for bit in reversed(range(BITS)))
    for start in range(0, BLOCK_PX * stride, stride):
        luma[start : start + WIDTH_PX] = row
    return ticks * TICK_S


def read(row: bytes) -> float | None:
    """Reads a moment from the middle row of the blocks.

    Args:
        row: luma of row `BLOCK_PX // 2`, at least `WIDTH_PX` bytes.

    Returns:
        The moment in the past that was drawn, on `time.monotonic()`; None when the check bits don't fit.
    """
    code = 0
    for bit in range(BITS):
        middle = bit * BLOCK_PX + BLOCK_PX // 4
        inner = row[middle : middle + BLOCK_PX // 2]
        code = code << 1 | (sum(inner) > _MIDDLE * len(inner))
    value, check = divmod(code, 1 << _CHECK_BITS)
    if check != _check(value):
        return None
    now = round(time.monotonic() / TICK_S)
    # The number wraps every five days: the newest moment with these low bits that is not in the future.
    return (now - (now - value) % (1 << _VALUE_BITS)) * TICK_S


def _check(value: int) -> int:
    """Eight bits that a frame without a stamp, or a torn one, is unlikely to have."""
    return (value * 0x9E3779B1 >> 24 & 0xFF) ^ 0x5A
