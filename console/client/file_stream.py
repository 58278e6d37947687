"""One file of a recording over one connection: a header, then chunks, each with its CRC-32C."""

from collections.abc import AsyncGenerator
from typing import Any, Final, Protocol

import google_crc32c

from console.client.errors import GatewayFailed, Unreachable
from console.client.mapping.methods import EXPORT_RECORDING, Method
from console.client.mapping.recording import export_request
from console.client.results import ExportChunk, ExportHeader, RecordingFile

SILENT_S: Final = 30.0
"""The robot sends a chunk at least every 5 s, however slowly it was requested to send."""


class PullStream(Protocol):
    """One export."""

    async def read(self, within_s: float | None = None) -> Any:
        """Returns the next part, or raises a `GatewayError`."""

    def cancel(self) -> None:
        """Ends it."""


class ExportTransport(Protocol):
    """What an export needs of a transport."""

    def pull(self, method: Method[Any], request: bytes) -> PullStream:
        """Starts an export."""

    async def sleep(self, seconds: float) -> None:
        """Sleeps, or raises `Cancelled` when the client is closed."""


async def file_bytes(
    transport: ExportTransport,
    recording_id: str,
    file: RecordingFile,
    offset: int = 0,
    *,
    max_bytes_per_s: int = 0,
) -> AsyncGenerator[bytes]:
    """Yields the bytes of a file, each checked against its CRC-32C, over one connection.

    Args:
        transport: Carries the stream out.
        recording_id: Of the file's recording.
        file: As the robot has listed it.
        offset: Where to begin.
        max_bytes_per_s: 0: as configured on the robot.

    Raises:
        GatewayError: The connection is cut or silent for SILENT_S, a chunk is damaged, or the robot refuses.
    """
    request = export_request(
        recording_id, file.name, offset=offset, expected_sha256=file.sha256, max_bytes_per_s=max_bytes_per_s
    )
    stream = transport.pull(EXPORT_RECORDING, request)
    try:
        header = await stream.read(SILENT_S)
        if not isinstance(header, ExportHeader) or header.size != file.size:
            raise GatewayFailed(f"the robot sent no valid header for {file.name}")
        while offset < file.size:
            chunk = await stream.read(SILENT_S)
            data = _checked(chunk, offset, file)
            offset += len(data)
            yield data
    finally:
        stream.cancel()


def chunk_of(data: bytes, offset: int) -> ExportChunk:
    """Returns bytes from elsewhere as a robot would send them."""
    return ExportChunk(offset=offset, data=data, crc32c=google_crc32c.value(data))


def _checked(chunk: Any, expected_offset: int, file: RecordingFile) -> bytes:
    """Returns the bytes of a chunk.

    Raises:
        Unreachable: It is damaged, or not the next one: as good as a cut.
    """
    if not isinstance(chunk, ExportChunk) or chunk.offset != expected_offset or not chunk.data:
        raise Unreachable(f"{file.name}: what came is not the next part")
    if len(chunk.data) > file.size - expected_offset or google_crc32c.value(chunk.data) != chunk.crc32c:
        raise Unreachable(f"{file.name}: a part arrived damaged")
    return chunk.data
