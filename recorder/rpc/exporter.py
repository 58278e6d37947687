"""ExportRecording: which file a caller may read, and how its bytes get to the gateway.

| what happens meanwhile | what follows |
|---|---|
| the recording is deleted | the file is closed at once, also by the gateway; RECORDING_DELETED |
| the disk reads other bytes than were written, or none | the end is withheld; RECORDING_DAMAGED |
| the caller leaves | the file is closed, and no more of it is read |
| the caller does not read | the export waits; the gateway ends it |
"""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Sequence
from contextlib import aclosing, asynccontextmanager
from typing import Any, Final

import grpc

from common.deadline import within
from common.errors import (
    ConflictError,
    DamagedError,
    DomainError,
    InvalidRequestError,
    NotFoundError,
    PreconditionError,
    RecorderUnreachableError,
    TooMuchError,
)
from common.export_connection import CONNECT_WITHIN_S, KEY_HEADER, OPENED_HEADER, key_of
from common.open_file import UnreadableError
from common.pace import Pace
from common.paced_chunks import paced_chunks
from common.reader_threads import ClosedError
from common.reasons import Reason
from common.tasks import first_to_end
from omniseer.gateway.v1 import recording_pb2 as pb
from recorder.recording.status_reader import StatusReader
from recorder.rpc import mapping
from recorder.rpc.export_connections import ExportConnection, ExportConnections
from recorder.store.bundle_reader import BundleReader
from recorder.store.export import Content, Export, export
from recorder.store.readers import Readers
from recorder.store.run_bundles import Bundle
from recorder.store.sums import Sums

_READ_LATER_S: Final = 5.0
"""Suggested to a caller whose file the recorder has still to read for its sum."""


class Exporter:
    """Exports of recordings and run bundles.

    Args:
        status_reader: of the recorder.
        bundles: the robot's own experiments.
        readers: threads that read.
        sums: of files.
        connections: hand files over to a gateway that connects there.
        max_bytes_per_s: of all exports together; 0 for no limit.
    """

    def __init__(
        self,
        status_reader: StatusReader,
        bundles: BundleReader,
        readers: Readers,
        sums: Sums,
        *,
        connections: ExportConnections,
        max_bytes_per_s: int,
    ) -> None:
        self._status_reader = status_reader
        self._bundles = bundles
        self._readers = readers
        self._sums = sums
        self._connections = connections
        self._pace = Pace(max_bytes_per_s)

    async def responses(
        self, request: pb.ExportRecordingRequest, bundle: Bundle | None, context: Any
    ) -> AsyncGenerator[pb.ExportRecordingResponse]:
        """Yields the header, and the chunks that no connection carries.

        Args:
            request: which file, and from where on.
            bundle: that it is of; None for a recording.
            context: of the call.

        Raises:
            DomainError: the file may not be read, or can't be.
        """
        content = await self._content(request, bundle)
        if request.expected_sha256 and request.expected_sha256 != content.sha256:
            raise ConflictError(
                f"{request.file} is another file than the one that was begun; begin anew",
                Reason.RECORDING_CHANGED,
            )
        if request.offset > content.size:
            raise InvalidRequestError(f"offset {request.offset} is beyond the end, {content.size}")
        try:
            async with (
                export(content, self._readers, self._sums) as exported,
                self._closed_on_deletion(exported, request.recording_id, bundle),
                aclosing(self._parts(exported, request, context)) as parts,
            ):
                async for part in parts:
                    yield part
        except (UnreadableError, ClosedError) as error:
            raise self._failure(request, bundle, error) from error

    async def _parts(
        self, exported: Export, request: pb.ExportRecordingRequest, context: Any
    ) -> AsyncGenerator[pb.ExportRecordingResponse]:
        size, sha256 = exported.file.size, exported.sha256
        header = pb.ExportRecordingResponse(header=pb.ExportHeader(size=size, sha256=sha256))
        pace = Pace(request.max_bytes_per_s)
        # The limit of all exports together is kept here, whichever client calls.
        key = None if self._pace.bytes_per_s else key_of(metadata(context, KEY_HEADER))
        with self._connections.expected(key) as coming:
            if coming:
                await context.send_initial_metadata(((OPENED_HEADER, "1"),))
            yield header
            connection = await _in_time(coming) if coming else None
            if connection and await _handed_over(connection, exported, request):
                await _read_elsewhere(connection, exported)
                return
            chunks = paced_chunks(
                exported.file, request.offset, (self._pace, pace), before_end=exported.verified
            )
            async with aclosing(chunks):
                async for chunk in chunks:
                    yield mapping.export_chunk(chunk)

    @asynccontextmanager
    async def _closed_on_deletion(
        self, exported: Export, recording_id: str, bundle: Bundle | None
    ) -> AsyncIterator[None]:
        """Closes the file when its recording is deleted while the block lasts."""

        async def close() -> None:
            await self._status_reader.changes.wait_until(lambda: not self._status_reader.has(recording_id))
            exported.close()

        watch = None if bundle else asyncio.create_task(close(), name=f"deletion of {recording_id}")
        try:
            yield
        finally:
            if watch:
                watch.cancel()

    def _failure(
        self, request: pb.ExportRecordingRequest, bundle: Bundle | None, error: Exception
    ) -> DomainError:
        if bundle is None and not self._status_reader.has(request.recording_id):
            return ConflictError(
                f"recording {request.recording_id} was deleted meanwhile", Reason.RECORDING_DELETED
            )
        return DamagedError(f"{request.file}: {error}")

    async def _content(self, request: pb.ExportRecordingRequest, bundle: Bundle | None) -> Content:
        if bundle:
            return await self._bundle_content(bundle, request.file)
        manifest = self._status_reader.get(request.recording_id)
        for file in manifest.files:
            if file.name == request.file:
                path = self._status_reader.folder_of(manifest) / file.name
                return Content(path, file.size, bytes.fromhex(file.sha256))
        if request.file == self._status_reader.live(manifest).part:
            raise _not_final(request.file)
        raise _no_such_file(manifest.id, request.file)

    async def _bundle_content(self, bundle: Bundle, name: str) -> Content:
        file = bundle.file(name)
        if file is None:
            raise _no_such_file(bundle.id, name)
        if not bundle.final:
            raise _not_final(name)
        try:
            sha256 = await self._bundles.sha256(bundle, file)
        except UnreadableError as error:
            raise DamagedError(f"{name}: {error}") from error
        if sha256 is None:
            raise TooMuchError(
                f"the robot is still reading {name} to compute its SHA-256; try again in a moment",
                Reason.TOO_MANY_REQUESTS,
                _READ_LATER_S,
            )
        return Content(bundle.folder / file.name, file.size, sha256)


def metadata(context: grpc.aio.ServicerContext[Any, Any], wanted: str) -> str | bytes:
    """Returns the first value of a key; empty without one."""
    found: Sequence[tuple[str, str | bytes]] = tuple(context.invocation_metadata() or ())
    return next((value for key, value in found if key == wanted), "")


async def _in_time(coming: "asyncio.Future[ExportConnection]") -> ExportConnection | None:
    """Returns the connection of an export; None if the gateway does not connect."""
    try:
        return await within(CONNECT_WITHIN_S, coming)
    except TimeoutError:
        return None


async def _handed_over(
    connection: ExportConnection, exported: Export, request: pb.ExportRecordingRequest
) -> bool:
    """Hands the file over; returns False where the gateway can't take it.

    Raises:
        RecorderUnreachableError: whether it has taken it is unknown.
    """
    try:
        handing = connection.hand_over(exported.file, request.offset, request.max_bytes_per_s)
        return await within(CONNECT_WITHIN_S, handing)
    except TimeoutError:
        raise RecorderUnreachableError("the gateway has not taken the file of an export") from None


async def _read_elsewhere(connection: ExportConnection, exported: Export) -> None:
    """Returns when the gateway has read the file, and all of it is verified.

    Raises:
        UnreadableError: it has another sum.
        ClosedError: it was closed meanwhile.
    """
    await first_to_end(connection.disconnected(), exported.closed.wait())
    await exported.verified()


def _no_such_file(recording_id: str, name: str) -> NotFoundError:
    text = f"{recording_id} has no file '{name}'; GetRecording has those there are"
    return NotFoundError(text, Reason.RECORDING_NOT_FOUND)


def _not_final(name: str) -> PreconditionError:
    text = f"{name} is still being written; wait for the next file, or stop the recording"
    return PreconditionError(text, Reason.FILE_NOT_FINAL)
