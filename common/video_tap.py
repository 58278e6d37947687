"""Records of the video tap: what the preview's encoder made, for the recorder on the same machine.

A stream of records over a Unix socket. Each is a header of 24 bytes, little endian, and a payload:

    u32 'RGV1' | u32 payload length | u8 kind | u8 flags | u16 0 | u64 capture time | u32 0

The capture time is on CLOCK_MONOTONIC in ns, 0 where the record has none. Pure.
"""

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final

MAGIC: Final = b"RGV1"
MAX_PAYLOAD_BYTES: Final = 8 << 20
_HEADER: Final = struct.Struct("<4sIBBHQI")
HEADER_BYTES: Final = _HEADER.size
_KEY_FRAME: Final = 1


class Kind(IntEnum):
    """What a record has in its payload."""

    ACCESS_UNIT = 0
    """One access unit as a byte stream (ISO/IEC 14496-10 and 23008-2, annex B)."""
    INFO = 1
    """JSON object: parameters of the stream, from here on."""
    GAP = 2
    """JSON object: `frames` (null: not known) that are missing here, between those captured at `from_ns` and
    `to_ns`."""


class MalformedRecordError(Exception):
    """Bytes that are no record."""


@dataclass(frozen=True, slots=True)
class Header:
    """Header of a record.

    Args:
        kind: of the payload.
        length: of the payload in bytes.
        key_frame: whether an access unit decodes without earlier ones.
        captured_ns: capture time on CLOCK_MONOTONIC; 0: none.
    """

    kind: Kind
    length: int
    key_frame: bool = False
    captured_ns: int = 0

    def encode(self) -> bytes:
        """Returns the header's bytes."""
        flags = _KEY_FRAME if self.key_frame else 0
        return _HEADER.pack(MAGIC, self.length, self.kind, flags, 0, self.captured_ns, 0)


def decode_header(encoded: bytes) -> Header:
    """Returns the header of a record; flags that are not known are ignored.

    Raises:
        MalformedRecordError: not a header, of an unknown kind, or of a payload that is too long.
    """
    if len(encoded) != HEADER_BYTES:
        raise MalformedRecordError(f"a header of {len(encoded)} bytes")
    magic, length, kind, flags, _, captured_ns, _ = _HEADER.unpack(encoded)
    if magic != MAGIC:
        raise MalformedRecordError(f"a record begins with {magic!r}, not with {MAGIC!r}")
    if length > MAX_PAYLOAD_BYTES:
        raise MalformedRecordError(f"a payload of {length} bytes; at most {MAX_PAYLOAD_BYTES} are allowed")
    if kind not in set(Kind):
        raise MalformedRecordError(f"a record of kind {kind}")
    return Header(Kind(kind), length, bool(flags & _KEY_FRAME), captured_ns)


def encode_object(kind: Kind, content: Mapping[str, Any]) -> bytes:
    """Returns a whole record with a JSON object."""
    payload = json.dumps(content).encode()
    return Header(kind, len(payload)).encode() + payload


def decode_object(payload: bytes) -> dict[str, Any]:
    """Returns the JSON object of a payload.

    Raises:
        MalformedRecordError: it is none.
    """
    try:
        content = json.loads(payload)
    except (ValueError, RecursionError) as error:
        raise MalformedRecordError("a payload that is no JSON") from error
    if not isinstance(content, dict):
        raise MalformedRecordError("a payload that is no JSON object")
    return content
