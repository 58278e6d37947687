"""Size of a compressed picture, from its header alone. Pure.

A decoder takes memory for as many pixels as the header names, so they are counted before it gets the picture.
"""

from typing import Final

from tap.refusal import Reason, RefusedError

_JPEG: Final = b"\xff\xd8\xff"
_PNG: Final = b"\x89PNG\r\n\x1a\n"
_SIZE_FRAMES: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""SOF0 to SOF15, without DHT, JPG and DAC (ITU-T T.81 table B.1)."""
_ALONE: Final = frozenset({0x01, *range(0xD0, 0xD9)})
"""Markers without a length: TEM, RST0 to RST7, SOI."""
_START_OF_SCAN: Final = 0xDA
_MOST_SEGMENTS: Final = 1000
"""And fill bytes before them: each takes a while to look at."""
_SOF_BYTES: Final = 7
_IHDR_END: Final = 24


def measure(picture: memoryview) -> tuple[str, int, int]:
    """Returns the form of a picture, "jpeg" or "png", its width and its height in pixels.

    Raises:
        RefusedError: it is neither, or its header is not whole.
    """
    if bytes(picture[:3]) == _JPEG:
        return "jpeg", *_measure_jpeg(picture)
    if bytes(picture[:8]) == _PNG:
        return "png", *_measure_png(picture)
    raise RefusedError(Reason.COMPRESSED, "is neither a JPEG nor a PNG picture")


def _measure_jpeg(picture: memoryview) -> tuple[int, int]:
    """Walks the segments up to the frame header (ITU-T T.81 B.1.1 and B.2.2)."""
    at = 2
    for _ in range(_MOST_SEGMENTS):
        if at + 4 > len(picture) or picture[at] != 0xFF:
            break
        marker = picture[at + 1]
        if marker == 0xFF:
            at += 1  # Fill bytes may precede a marker.
            continue
        at += 2
        if marker in _ALONE:
            continue
        length = _u16(picture, at)
        if length < 2 or marker == _START_OF_SCAN:
            break
        if marker in _SIZE_FRAMES:
            if length < _SOF_BYTES or at + _SOF_BYTES > len(picture):
                break
            return _u16(picture, at + 5), _u16(picture, at + 3)
        at += length
    raise RefusedError(Reason.COMPRESSED, "is a JPEG picture without a frame header")


def _measure_png(picture: memoryview) -> tuple[int, int]:
    """Reads the first chunk (ISO/IEC 15948 11.2.2)."""
    if len(picture) < _IHDR_END or bytes(picture[12:16]) != b"IHDR":
        raise RefusedError(Reason.COMPRESSED, "is a PNG picture without a header")
    return int.from_bytes(picture[16:20], "big"), int.from_bytes(picture[20:24], "big")


def _u16(picture: memoryview, at: int) -> int:
    return int.from_bytes(picture[at : at + 2], "big")
