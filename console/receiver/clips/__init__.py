"""Compressed clips that every decoder must be able to decode, for the trial of a decoder.

`h264.units` and `h265.units` hold ten frames of 320x240, colour bars, as the robot's encoders make them: one
key frame, no B-frames. Each access unit (byte stream) stands behind its length, four bytes, big-endian.
tests/support/clips.py makes them.
"""

from importlib.resources import files
from typing import Final

WIDTH_PX: Final = 320
HEIGHT_PX: Final = 240
LENGTH_BYTES: Final = 4


def units(codec: str) -> list[bytes]:
    """Returns the access units in decoding order.

    Args:
        codec: "h264" or "h265".
    """
    content = files(__package__).joinpath(f"{codec}.units").read_bytes()
    found, at = [], 0
    while at < len(content):
        end = at + LENGTH_BYTES + int.from_bytes(content[at : at + LENGTH_BYTES])
        found.append(content[at + LENGTH_BYTES : end])
        at = end
    return found
