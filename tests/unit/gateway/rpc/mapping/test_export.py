"""The message of a chunk, made in parts, is the one that protobuf makes."""

import pytest

from common.open_file import CHUNK_BYTES, Chunk
from gateway.rpc.mapping.export import message_parts
from omniseer.gateway.v1 import recording_pb2 as pb
from recorder.rpc import mapping

MAX_MESSAGE_BYTES = 256 * 1024 + 64
"""A chunk, with what frames it in its message."""


@pytest.mark.parametrize("offset", [0, 1, 127, 128, 2**32, 2**64 - 1])
@pytest.mark.parametrize("size", [1, 100, 127, 128, 16_384, CHUNK_BYTES])
@pytest.mark.parametrize("crc32c", [0, 1, 2**32 - 1])
def test_parts_are_what_protobuf_serialises(offset: int, size: int, crc32c: int) -> None:
    chunk = Chunk(offset, b"\x12" * size, crc32c)
    message = b"".join(message_parts(chunk))
    assert message == mapping.export_chunk(chunk).SerializeToString()
    assert len(message) <= MAX_MESSAGE_BYTES
    assert pb.ExportRecordingResponse.FromString(message).chunk.data == chunk.data
    assert message_parts(chunk)[1] is chunk.data, "it was copied"
