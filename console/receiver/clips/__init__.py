"""A few compressed pictures that every decoder must be able to decode, for trying one before it is relied on.

`h264.units` and `h265.units` hold ten pictures of 320x240, colour bars, as the robot's encoders make them:
one key frame, no B-frames. Each access unit (byte stream) stands behind its length, four bytes, big-endian.
tests/support/clips.py makes them.
"""

from importlib.resources import files
from typing import Final

PICTURES: Final = 10
WIDTH_PX: Final = 320
HEIGHT_PX: Final = 240
_LENGTH_BYTES: Final = 4


def units(codec: str) -> list[bytes]:
    """The access units, in the order of the pictures.

    Args:
        codec: "h264" or "h265".
    """
    content = files(__package__).joinpath(f"{codec}.units").read_bytes()
    found, at = [], 0
    while at < len(content):
        length = int.from_bytes(content[at : at + _LENGTH_BYTES])
        found.append(content[at + _LENGTH_BYTES : at + _LENGTH_BYTES + length])
        at += _LENGTH_BYTES + length
    return found


def packed(found: list[bytes]) -> bytes:
    """A file's content."""
    return b"".join(len(unit).to_bytes(_LENGTH_BYTES) + unit for unit in found)
