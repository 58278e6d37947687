"""An ExportRecordingResponse with a chunk, serialised in parts, so that the data is not copied."""

from typing import Final

from common.open_file import Chunk
from omniseer.gateway.v1 import recording_pb2 as pb

_LENGTH_DELIMITED: Final = 2
"""Wire type of messages and bytes (protobuf.dev/programming-guides/encoding)."""


def message_parts(chunk: Chunk) -> tuple[bytes, bytes, bytes]:
    """Returns the message in three parts; the middle one is the chunk's data, which is not empty."""
    before = pb.ExportChunk(offset=chunk.offset).SerializeToString() + _DATA + _varint(len(chunk.data))
    after = pb.ExportChunk(crc32c=chunk.crc32c).SerializeToString()
    size = len(before) + len(chunk.data) + len(after)
    return _CHUNK + _varint(size) + before, chunk.data, after


def _varint(number: int) -> bytes:
    """Returns a number in base 128, the low digits first, each but the last with its high bit set."""
    digits = bytearray()
    while number > 0x7F:
        digits.append(number & 0x7F | 0x80)
        number >>= 7
    digits.append(number)
    return bytes(digits)


def _tag(number: int) -> bytes:
    return _varint(number << 3 | _LENGTH_DELIMITED)


_CHUNK: Final = _tag(pb.ExportRecordingResponse.CHUNK_FIELD_NUMBER)
_DATA: Final = _tag(pb.ExportChunk.DATA_FIELD_NUMBER)
