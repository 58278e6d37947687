"""Messages foxglove_msgs/msg/CompressedVideo, encoded without ROS: the package need not be installed. Pure.

CDR is that of OMG DDSI-RTPS and DDS-XTypes, 7.4.1 (plain, version 1, little endian): alignment counts from
the end of the encapsulation header, a string has its final NUL in its length.
"""

import struct
from dataclasses import dataclass
from typing import Final

TYPE: Final = "foxglove_msgs/msg/CompressedVideo"
SCHEMA: Final = (
    b"builtin_interfaces/Time timestamp\n"
    b"string frame_id\n"
    b"uint8[] data\n"
    b"string format\n"
    b"================================================================================\n"
    b"MSG: builtin_interfaces/Time\n"
    b"int32 sec\n"
    b"uint32 nanosec\n"
)
"""As "ros2msg" of the MCAP registry: the definition, then those of the types it contains."""
MAX_TIME_NS: Final = (1 << 31) * 1_000_000_000
"""Of builtin_interfaces/Time: `sec` is an int32."""
_LITTLE_ENDIAN: Final = b"\0\1\0\0"
_TIME: Final = struct.Struct("<iI")
_LENGTH: Final = struct.Struct("<I")
_ALIGNMENT: Final = 4


def encode(captured_ns: int, frame_id: str, unit: bytes, codec: str) -> bytes:
    """Returns a message.

    Args:
        captured_ns: capture time by the calendar clock, from 0 to below MAX_TIME_NS.
        frame_id: of the camera.
        unit: the access unit.
        codec: "h264" or "h265".
    """
    head = _TIME.pack(*divmod(captured_ns, 1_000_000_000)) + _string(frame_id)
    head += _padding(len(head)) + _LENGTH.pack(len(unit))
    end = _padding(len(head) + len(unit)) + _string(codec)
    return b"".join((_LITTLE_ENDIAN, head, unit, end))


def _string(text: str) -> bytes:
    encoded = text.encode() + b"\0"
    return _LENGTH.pack(len(encoded)) + encoded


def _padding(size: int) -> bytes:
    return b"\0" * (-size % _ALIGNMENT)


@dataclass(frozen=True, slots=True)
class Frame:
    """A decoded message: capture time by the calendar clock, one access unit, "h264" or "h265"."""

    captured_ns: int
    unit: bytes
    codec: str


def decode(data: bytes) -> Frame | None:
    """Returns a message that `encode` made; None for anything else."""
    if data[: len(_LITTLE_ENDIAN)] != _LITTLE_ENDIAN:
        return None
    content = data[len(_LITTLE_ENDIAN) :]
    try:
        seconds, nanoseconds = _TIME.unpack_from(content)
        _, at = _counted(content, _TIME.size)
        unit, at = _counted(content, at + -at % _ALIGNMENT)
        codec, _ = _counted(content, at + -at % _ALIGNMENT)
    except (struct.error, ValueError):
        return None
    if codec not in (b"h264\0", b"h265\0"):
        return None
    return Frame(seconds * 1_000_000_000 + nanoseconds, unit, codec[:-1].decode())


def _counted(content: bytes, at: int) -> tuple[bytes, int]:
    """Returns the bytes that a length announces, and where they end."""
    (size,) = _LENGTH.unpack_from(content, at)
    begin = at + _LENGTH.size
    if begin + size > len(content):
        raise ValueError("it is shorter than its own lengths")
    return content[begin : begin + size], begin + size
