"""RecorderService of a recorder in this process, over a real socket."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import google_crc32c
import grpc

from common import bind, rpc
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.recorder.v1 import recorder_service_pb2_grpc as pb_grpc
from recorder.rpc.export_connections import ExportConnections
from recorder.rpc.servicer import RecorderServicer
from recorder.store.readers import reader_threads
from tests.support.recorder_in_process import Running, Source, running_recorder

KIB = 1024


@dataclass
class Served:
    """A recorder behind its socket."""

    stub: Any
    running: Running

    async def recorded(self, size: int = 1000, messages: int = 10) -> pb.Recording:
        """A finished recording, with its files."""
        await self.stub.StartRecording(pb.StartRecordingRequest(request_id=f"start {size}", label="a"))
        Source(self.running.queue).send(messages, size=size // messages)
        stopped = await self.stub.StopRecording(pb.StopRecordingRequest(request_id=f"stop {size}"))
        asked = pb.GetRecordingRequest(recording_id=stopped.recording.id)
        found: pb.Recording = (await self.stub.GetRecording(asked)).recording
        return found


@asynccontextmanager
async def served(root: Path, **values: Any) -> AsyncIterator[Served]:
    async with running_recorder(root / "root", **values) as running:
        with reader_threads() as readers:
            server = rpc.new_server()
            connections = ExportConnections()
            servicer = RecorderServicer(
                running.operations, running.status_reader, running.settings, readers, connections
            )
            servicer.register(server)
            socket = root / "recorder.sock"
            bind.bind_unix(server, socket)
            await server.start()
            try:
                async with (
                    connections.listening(socket),
                    grpc.aio.insecure_channel(f"unix:{socket}") as channel,
                ):
                    yield Served(pb_grpc.RecorderServiceStub(channel), running)
            finally:
                await server.stop(None)
                await servicer.close()


async def exported(stub: Any, **request: Any) -> tuple[pb.ExportHeader, bytes]:
    """The header and the bytes of an export, in which every chunk has been checked."""
    header, content, offset = pb.ExportHeader(), bytearray(), request.get("offset", 0)
    async for part in stub.ExportRecording(pb.ExportRecordingRequest(**request)):
        if part.HasField("header"):
            header = part.header
            continue
        chunk = part.chunk
        assert chunk.offset == offset + len(content)
        assert 0 < len(chunk.data) <= 256 * KIB
        assert chunk.crc32c == google_crc32c.value(chunk.data)
        content += chunk.data
    return header, bytes(content)
