"""What the preview and the camera tap say to each other: frames of ROS topics, over a Unix socket of packets.

The preview connects (SOCK_SEQPACKET), and names a topic in its first packet, a JSON object: `{"watch":
"/front/image_raw"}`. From then on each packet READY permits one frame, so that neither side ever has more
than one on the way. `{"status": true}` instead asks for the tap's state: the one packet that follows; with
`"examine": "/front/image_raw"` beside it that is a problem, empty if the topic is published as images. A tap
that is older sends its state.

A packet of the tap is a header of 48 bytes, little endian, and for some kinds a text:

    u32 'RGC1' | u8 kind | 3 x 0 | u32 width | u32 height | u64 bytes | u64 capture time | 16 bytes form

A frame's pixels are in a memfd that comes with its packet (SCM_RIGHTS), sealed so that it can't shrink: no
name, no room to be reused, and the kernel frees it when the last of the two lets go of it, however either
ends. The capture time is on CLOCK_MONOTONIC in ns. Pure.
"""

import json
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from types import MappingProxyType
from typing import Any, Final

MAGIC: Final = b"RGC1"
_HEADER: Final = struct.Struct("<4sB3xIIQQ16s")
HEADER_BYTES: Final = _HEADER.size
READY: Final = b"\x01"
MAX_REQUEST_BYTES: Final = 1024
MAX_PACKET_BYTES: Final = 8192
MAX_TEXT_BYTES: Final = 1000
MAX_SIDE_PX: Final = 8192
MAX_FRAME_BYTES: Final = 32 << 20
"""A frame of 3840x2160 pixels with four bytes each has 31.6 MiB."""
LEAST_SEALS: Final = 0x0002 | 0x0008
"""F_SEAL_SHRINK and F_SEAL_WRITE (fcntl.h): a memfd that shrinks under a mapping would end the reader with
SIGBUS, and one that changes could become another picture between a decoder's looks at size and content."""
TOPIC_PATTERN: Final = r"(/[A-Za-z_][A-Za-z0-9_]*)+"
"""Regular expression of a whole name."""
_TOPIC: Final = re.compile(TOPIC_PATTERN)
MAX_TOPIC_CHARACTERS: Final = 247
"""RMW_TOPIC_MAX_NAME_LENGTH."""

PACKED: Final[Mapping[str, int]] = MappingProxyType(
    {
        "RGB": 3,
        "BGR": 3,
        "RGBA": 4,
        "BGRA": 4,
        "GRAY8": 1,
        "GRAY16_LE": 2,
        "GRAY16_BE": 2,
        "UYVY": 2,
        "YUY2": 2,
        **{f"bayer-{order}": 1 for order in ("bggr", "gbrg", "grbg", "rggb")},
    }
)
"""Forms with one plane, and their bytes per pixel: video formats as GStreamer calls them."""
HALF_CHROMA: Final = frozenset({"NV12", "NV21"})
"""Forms with a second plane of half the height (4:2:0)."""
COMPRESSED: Final = frozenset({"jpeg", "png"})
"""Forms whose size follows from no formula."""
_EVEN_WIDTH: Final = HALF_CHROMA | {"UYVY", "YUY2"}


class Kind(IntEnum):
    """What a packet of the tap is."""

    FRAME = 0
    PROBLEM = 1
    """Text for people: why no frames come, or not all; empty once they come again."""
    STATUS = 2
    """JSON object: the state of the tap."""


class Asked(Enum):
    """What the first packet of a connection asks for."""

    FRAMES = "frames"
    STATE = "state"
    PROBLEM = "problem"
    """Why no frames of a topic can come."""


class MalformedPacketError(Exception):
    """A packet that is none of this protocol; the text says what it is, as the predicate of "it sent"."""


@dataclass(frozen=True, slots=True)
class Header:
    """Header of a packet; a frame's is complete, of the others only the kind counts.

    Args:
        kind: of the packet.
        width: in pixels.
        height: in pixels.
        size: of the frame in bytes.
        captured_ns: capture time on CLOCK_MONOTONIC.
        form: of the pixels: one of PACKED, HALF_CHROMA or COMPRESSED.
    """

    kind: Kind
    width: int = 0
    height: int = 0
    size: int = 0
    captured_ns: int = 0
    form: str = ""

    def encode(self) -> bytes:
        """Returns the header's bytes."""
        return _HEADER.pack(
            MAGIC, self.kind, self.width, self.height, self.size, self.captured_ns, self.form.encode("ascii")
        )


def is_topic(name: str) -> bool:
    """Whether this can be the full name of a topic (design.ros2.org, "Topic and Service name mapping")."""
    return len(name) <= MAX_TOPIC_CHARACTERS and bool(_TOPIC.fullmatch(name))


def row_bytes(form: str, width: int) -> int:
    """Returns the bytes of a row in memory, of the first plane: a multiple of four, as GStreamer has them."""
    return (width * PACKED.get(form, 1) + 3) // 4 * 4


def frame_bytes(form: str, width: int, height: int) -> int | None:
    """Returns how large a frame is; None where only its content says so."""
    if form in COMPRESSED:
        return None
    rows = height + height // 2 if form in HALF_CHROMA else height
    return row_bytes(form, width) * rows


def size_problem(form: str, width: int, height: int) -> str:
    """Returns why no frame can have this size, as the predicate of "it"; empty if one can."""
    if not (0 < width <= MAX_SIDE_PX and 0 < height <= MAX_SIDE_PX):
        return f"has {width}x{height} pixels; 1 to {MAX_SIDE_PX} are possible"
    odd = (form in _EVEN_WIDTH and width % 2) or (form in HALF_CHROMA and height % 2)
    if odd:
        return f"has {width}x{height} pixels, and {form} needs an even number of them"
    if (size := frame_bytes(form, width, height) or 0) > MAX_FRAME_BYTES:
        return f"has {size} bytes; at most {MAX_FRAME_BYTES} are possible"
    return ""


def decode(packet: bytes) -> tuple[Header, bytes]:
    """Returns the header of a packet, and what follows it.

    Raises:
        MalformedPacketError: it is none, or of a frame that can't be.
    """
    if len(packet) < HEADER_BYTES:
        raise MalformedPacketError(f"a packet of {len(packet)} bytes")
    magic, kind, width, height, size, captured_ns, form = _HEADER.unpack_from(packet)
    if magic != MAGIC:
        raise MalformedPacketError(f"a packet that begins with {magic!r}, not with {MAGIC!r}")
    if kind not in set(Kind):
        raise MalformedPacketError(f"a packet of kind {kind}")
    name = form.rstrip(b"\0").decode("ascii", "replace")
    header = Header(Kind(kind), width, height, size, captured_ns, name)
    if header.kind is Kind.FRAME:
        _check(header)
    return header, packet[HEADER_BYTES:]


def _check(frame: Header) -> None:
    if not (frame.form in PACKED or frame.form in HALF_CHROMA or frame.form in COMPRESSED):
        raise MalformedPacketError(f"a frame of the form {frame.form!r}")
    if problem := size_problem(frame.form, frame.width, frame.height):
        raise MalformedPacketError(f"a frame that {problem}")
    needed = frame_bytes(frame.form, frame.width, frame.height)
    if not 0 < frame.size <= MAX_FRAME_BYTES or needed not in (None, frame.size):
        raise MalformedPacketError(
            f"a frame of {frame.size} bytes for {frame.width}x{frame.height} pixels of {frame.form}"
        )


def encode_text(kind: Kind, text: str) -> bytes:
    """Returns a whole packet with a text, which is cut to MAX_TEXT_BYTES where it is a PROBLEM."""
    content = text.encode("utf-8", "replace")
    if kind is Kind.PROBLEM:
        content = content[:MAX_TEXT_BYTES]
    return Header(kind).encode() + content


def decode_text(content: bytes) -> str:
    """Returns the text of a packet as one printable line."""
    text = content[:MAX_TEXT_BYTES].decode("utf-8", "replace")
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def encode_watch(topic: str) -> bytes:
    """Returns the first packet of a connection that is to get a topic's frames."""
    return json.dumps({"watch": topic}).encode()


STATUS_REQUEST: Final = json.dumps({"status": True}).encode()


def encode_examine(topic: str) -> bytes:
    """Returns the only packet of a connection that asks for a topic's problem."""
    return json.dumps({"status": True, "examine": topic}).encode()


def decode_request(packet: bytes) -> tuple[Asked, str]:
    """Returns what the first packet of a connection asks for, and of which topic; empty with STATE.

    Raises:
        MalformedPacketError: it is no request.
    """
    request = decode_object(packet)
    asked, key = Asked.FRAMES, "watch"
    if request.get("status") is True:
        if "examine" not in request:
            return Asked.STATE, ""
        asked, key = Asked.PROBLEM, "examine"
    topic = request.get(key)
    if not isinstance(topic, str) or not is_topic(topic):
        raise MalformedPacketError("a request that names no topic")
    return asked, topic


def decode_object(packet: bytes) -> dict[str, Any]:
    """Returns a JSON object.

    Raises:
        MalformedPacketError: it is none.
    """
    try:
        content = json.loads(packet)
    except (ValueError, RecursionError) as error:
        raise MalformedPacketError("a packet that is no JSON") from error
    if not isinstance(content, dict):
        raise MalformedPacketError("a packet that is no JSON object")
    return content
