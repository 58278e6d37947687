"""A bare gRPC server of constant bytes: `python -m bench.export.bare_server FILE...`.

It has the files in memory, as the messages that an export has, and streams them as fast as its caller takes
them: no disk, no checksum, no second program. Ends when its standard input closes.
"""

import asyncio
import sys
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any, Final

import google_crc32c
import grpc
import uvloop

from common.open_file import CHUNK_BYTES
from omniseer.gateway.v1 import recording_pb2 as pb

METHOD: Final = "/bench.Export/Copy"


def messages(files: Sequence[Path]) -> list[bytes]:
    """Returns what an export of these files sends, serialised."""
    made = []
    for file in files:
        content = file.read_bytes()
        made.append(pb.ExportRecordingResponse(header=pb.ExportHeader(size=len(content), sha256=bytes(32))))
        for offset in range(0, len(content), CHUNK_BYTES):
            data = content[offset : offset + CHUNK_BYTES]
            chunk = pb.ExportChunk(offset=offset, data=data, crc32c=google_crc32c.value(data))
            made.append(pb.ExportRecordingResponse(chunk=chunk))
    return [each.SerializeToString() for each in made]


async def main(files: Sequence[Path]) -> None:
    constant = messages(files)

    async def copy(_request: bytes, _context: Any) -> AsyncIterator[bytes]:
        for each in constant:
            yield each

    _, service, method = METHOD.split("/")
    handlers: Any = {method: grpc.unary_stream_rpc_method_handler(copy)}
    server = grpc.aio.server()
    server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler(service, handlers),))
    port = server.add_insecure_port("127.0.0.1:0")
    await server.start()
    print(f"ready {port}", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    await server.stop(None)


if __name__ == "__main__":
    uvloop.run(main([Path(each) for each in sys.argv[1:]]))
