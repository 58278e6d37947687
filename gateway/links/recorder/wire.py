"""Schema and client of the recorder (omniseer.recorder.v1).

Its messages are mostly those of the operators' contract. They are passed on as bytes, so that this side needs
no knowledge of them, and an export costs the gateway no parsing.
"""

import asyncio
import secrets
from collections.abc import AsyncGenerator, AsyncIterator, Sequence
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import grpc

from common.export_connection import KEY_BYTES, KEY_HEADER, OPENED_HEADER, socket_beside
from common.open_file import Chunk
from common.paced_chunks import paced_chunks
from common.reader_threads import ClosedError, ReaderThreads
from common.tasks import cancel
from gateway.links.grpc_client import lost, unix_channel
from gateway.links.recorder.export_connection import HandedFile, handed_file
from gateway.links.watch import LinkLostError
from gateway.links.wire_values import by_number, same_fields
from gateway.status.cloud import CopyReport, RecordingCopyState
from gateway.status.fault import Severity
from gateway.status.recording import (
    ENDED,
    RecorderReport,
    RecorderState,
    RecorderStatus,
    RecordingBrief,
    RecordingKind,
    RecordingPreset,
    RecordingState,
    RecordingStopReason,
)
from omniseer.recorder.v1 import recorder_service_pb2 as pb
from omniseer.recorder.v1.recorder_service_pb2_grpc import RecorderServiceStub

if TYPE_CHECKING:
    # Exists in the generated stubs alone: the name that a type checker knows the asyncio form by.
    from omniseer.recorder.v1.recorder_service_pb2_grpc import RecorderServiceAsyncStub

Metadata = Sequence[tuple[str, str]]

_SERVICE: Final = f"/{pb.DESCRIPTOR.services_by_name['RecorderService'].full_name}"
_MAX_MESSAGE_BYTES: Final = 4 * 1024 * 1024
"""A thumbnail has up to 2 MiB, a recording up to 10000 files."""
_READERS: Final = 3
"""Threads that read files of exports: a disk that hangs keeps nothing else of the gateway waiting."""
_MOST_READS: Final = 64
"""More than all exports that there may be."""
_EXPORT_AHEAD_BYTES: Final = 1024 * 1024
"""Four chunks of each export, so that the recorder sends the next ones while one is passed on."""
_REPORT: Final = pb.WatchStateResponse.DESCRIPTOR.fields_by_name
_STATUS: Final = _REPORT["status"].message_type
_RECORDING: Final = _REPORT["ended"].message_type


STATES: Final = by_number(RecorderState, _STATUS, "state", "RECORDER_STATE")
KINDS: Final = by_number(RecordingKind, _RECORDING, "kind", "RECORDING_KIND")
RECORDING_STATES: Final = by_number(RecordingState, _RECORDING, "state", "RECORDING_STATE")
STOP_REASONS: Final = by_number(RecordingStopReason, _RECORDING, "stop_reason", "RECORDING_STOP_REASON")
_SEVERITIES: Final = by_number(Severity, pb.ReportFaultRequest.DESCRIPTOR, "severity", "FAULT_SEVERITY")
_COPY: Final = pb.SetCopyRequest.DESCRIPTOR.fields_by_name["copy"].message_type
_COPY_STATES: Final = by_number(RecordingCopyState, _COPY, "state", "RECORDING_COPY_STATE")


@dataclass(frozen=True, slots=True)
class RecorderConnector:
    """Connects to the recorder on the Unix socket where it listens, or will."""

    socket: Path

    @asynccontextmanager
    async def connect(self) -> AsyncIterator["RecorderClient"]:
        """Yields a client; connects with its first call."""
        threads = ReaderThreads("files", threads=_READERS, most=_MOST_READS)
        try:
            # Exports have a connection of their own: reports never wait behind their bytes.
            async with (
                unix_channel(self.socket, _MAX_MESSAGE_BYTES) as channel,
                unix_channel(self.socket, _MAX_MESSAGE_BYTES, ahead_bytes=_EXPORT_AHEAD_BYTES) as exports,
            ):
                yield RecorderClient(channel, exports, socket_beside(self.socket), threads)
        finally:
            # Last: the exports' calls have ended, and their files are closed.
            threads.close()


class RecorderClient:
    """A Reporter of the recorder, and its other methods. All but `reports` raise what gRPC raises.

    Args:
        channel: for all methods but one.
        exports: for ExportRecording.
        files_at: where the recorder takes connections by which it hands over the files of exports.
        threads: that read these files.
    """

    def __init__(
        self,
        channel: grpc.aio.Channel,
        exports: grpc.aio.Channel,
        files_at: Path,
        threads: ReaderThreads,
    ) -> None:
        self._channel = channel
        self._files_at = files_at
        self._threads = threads
        self._exports = exports
        self._stub: RecorderServiceAsyncStub = RecorderServiceStub(channel)

    async def reports(self) -> AsyncIterator[RecorderReport]:
        """Yields what WatchState reports."""
        stream = self._stub.WatchState(pb.WatchStateRequest())
        try:
            while isinstance(message := await stream.read(), pb.WatchStateResponse):
                yield report_from(message)
        except grpc.aio.AioRpcError as error:
            raise lost(error) from None

    async def call(self, method: str, request: bytes, timeout_s: float, metadata: Metadata) -> bytes:
        """Calls a method whose messages are the operators'; returns the response as it comes."""
        call: Any = self._channel.unary_unary(f"{_SERVICE}/{method}")
        response: bytes = await call(request, timeout=timeout_s, metadata=tuple(metadata))
        return response

    async def export(self, request: bytes, metadata: Metadata) -> AsyncGenerator[bytes | Chunk]:
        """Yields what ExportRecording responds with: as it is on the wire, or chunks of the file itself.

        Raises:
            UnreadableError: the disk can't read the file.
        """
        key = secrets.token_bytes(KEY_BYTES)
        method: Any = self._exports.unary_stream(f"{_SERVICE}/ExportRecording")
        call: Any = method(request, metadata=(*metadata, (KEY_HEADER, key.hex())))
        try:
            if (header := await call.read()) is grpc.aio.EOF:
                return
            yield header
            if any(name == OPENED_HEADER for name, _ in await call.initial_metadata()):
                async with handed_file(self._files_at, key, self._threads) as handed:
                    if handed:
                        async with aclosing(_chunks(handed, call)) as chunks:
                            async for chunk in chunks:
                                yield chunk
            # The status, and the chunks of a file that was not handed over.
            while (response := await call.read()) is not grpc.aio.EOF:
                yield response
        finally:
            call.cancel()

    async def report_fault(self, fault_id: str, severity: Severity, message: str, timeout_s: float) -> str:
        """Reports a fault; returns the incident that it became or was merged with, empty for none."""
        number: Any = next(number for number, each in _SEVERITIES.items() if each is severity)
        request = pb.ReportFaultRequest(fault_id=fault_id, severity=number, message=message)
        return (await self._stub.ReportFault(request, timeout=timeout_s)).recording_id

    async def set_copy(self, report: CopyReport, timeout_s: float) -> None:
        """Reports the state of a copy, which the recorder keeps."""
        copy = report.copy
        request = pb.SetCopyRequest(recording_id=report.recording_id)
        number: Any = next(number for number, each in _COPY_STATES.items() if each is copy.state)
        request.copy.state, request.copy.reason, request.copy.bytes_done = (
            number,
            copy.reason,
            copy.bytes_done,
        )
        await self._stub.SetCopy(request, timeout=timeout_s)


async def _chunks(handed: HandedFile, call: Any) -> AsyncGenerator[Chunk]:
    """Yields the chunks of a file, the last ones once the call has ended well.

    The file is closed as soon as the call ends.
    """
    ended = asyncio.ensure_future(call.read())
    ended.add_done_callback(lambda _: handed.file.close())

    async def verified() -> None:
        handed.finish()
        await ended

    try:
        async with aclosing(paced_chunks(handed.file, handed.offset, (handed.pace,), verified)) as chunks:
            async for chunk in chunks:
                yield chunk
    except ClosedError:
        await ended
    finally:
        await cancel([ended])


def report_from(message: pb.WatchStateResponse) -> RecorderReport:
    """Returns the report in a message.

    Raises:
        LinkLostError: the state is unknown, because the recorder is of another version than the gateway.
    """
    state = STATES.get(message.status.state)
    if state is None or state is RecorderState.UNREACHABLE:
        number = message.status.state
        raise LinkLostError(f"it reports the unknown state number {number}; its version does not match")
    presets = tuple(same_fields(RecordingPreset, each) for each in message.status.presets)
    ended = {each.id: each for each in map(_brief, (message.newest, *message.ended)) if each.state in ENDED}
    return same_fields(
        RecorderReport,
        message,
        status=same_fields(RecorderStatus, message.status, state=state, presets=presets),
        ended=tuple(ended.values()),
    )


def _brief(message: Any) -> RecordingBrief:
    return same_fields(
        RecordingBrief,
        message,
        kind=KINDS.get(message.kind),
        state=RECORDING_STATES.get(message.state),
        stop_reason=STOP_REASONS.get(message.stop_reason),
    )
