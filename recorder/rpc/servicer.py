"""RecorderService: receives, maps, calls, maps, replies."""

from collections.abc import AsyncIterator
from contextlib import aclosing
from typing import Any, Final

import grpc

from common.broadcast import HEARTBEAT_S
from common.errors import InvalidRequestError, NotFoundError, PreconditionError
from common.reasons import Reason
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.recorder.v1 import recorder_service_pb2 as recorder_pb
from omniseer.recorder.v1 import recorder_service_pb2_grpc as pb_grpc
from recorder.config import RecorderSettings
from recorder.recording.operations import Operations
from recorder.recording.requests import Result, SnapshotOptions, StartOptions
from recorder.recording.status_reader import StatusReader
from recorder.rpc import mapping
from recorder.rpc.export_connections import ExportConnections
from recorder.rpc.exporter import Exporter, metadata
from recorder.rpc.file_pages import file_page
from recorder.rpc.thumbnail import find_thumbnail
from recorder.store.bundle_reader import BundleReader
from recorder.store.manifest import Manifest
from recorder.store.readers import Readers
from recorder.store.run_bundles import Bundle, BundleSummary, RunBundles
from recorder.store.sums import Sums

SERVICE: Final = recorder_pb.DESCRIPTOR.services_by_name["RecorderService"].full_name

_HEARTBEAT_WRITING_S: Final = 0.5
_PAGE: Final = 50
_LARGEST_PAGE: Final = 200
_CALLER: Final = "x-caller"
_LONGEST_CALLER: Final = 100


class RecorderServicer(pb_grpc.RecorderServiceServicer):
    """RecorderService.

    Args:
        operations: of the recorder.
        status_reader: of the same.
        settings: of the program.
        readers: threads that read the disk for callers.
        connections: hand files of exports over to a gateway that connects there; None: gRPC carries all.
    """

    def __init__(
        self,
        operations: Operations,
        status_reader: StatusReader,
        settings: RecorderSettings,
        readers: Readers,
        connections: ExportConnections | None = None,
    ) -> None:
        sums = Sums(readers.files)
        self._operations = operations
        self._status_reader = status_reader
        self._settings = settings
        self._readers = readers
        self._messages = mapping.RecordingMessages()
        self._bundles = BundleReader(RunBundles(settings.run_bundles), readers.looks, sums)
        self._exporter = Exporter(
            status_reader,
            self._bundles,
            readers,
            sums,
            connections=connections or ExportConnections(),
            max_bytes_per_s=settings.export.max_bytes_per_s,
        )

    async def close(self) -> None:
        """Ends what is read in the background."""
        await self._bundles.close()

    def register(self, server: grpc.aio.Server) -> None:
        """Adds the methods to a server."""
        pb_grpc.add_RecorderServiceServicer_to_server(self, server)

    async def WatchState(  # noqa: N802  # the schema names it
        self, _request: recorder_pb.WatchStateRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> AsyncIterator[recorder_pb.WatchStateResponse]:
        """Streams the state, now and on every change; a slow reader skips outdated states."""
        async for _ in self._status_reader.changes.now_and_on_change(self._heartbeat_s):
            yield mapping.watch_state(self._status_reader, self._settings, self._messages)

    async def StartRecording(  # noqa: N802  # the schema names it
        self, request: pb.StartRecordingRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.StartRecordingResponse:
        """Starts a recording."""
        options = StartOptions(
            label=request.label,
            notes=request.notes,
            preset=request.preset,
            with_video=request.with_video if request.HasField("with_video") else None,
            max_duration_s=request.max_duration_s,
            max_bytes=request.max_bytes,
        )
        result = await self._operations.start(_request_id(request), options)
        return pb.StartRecordingResponse(message=result.message, recording=self._recording_of(result))

    async def StopRecording(  # noqa: N802  # the schema names it
        self, request: pb.StopRecordingRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.StopRecordingResponse:
        """Stops a recording."""
        result = await self._operations.stop(_request_id(request), request.recording_id)
        return pb.StopRecordingResponse(message=result.message, recording=self._recording_of(result))

    async def TriggerSnapshot(  # noqa: N802  # the schema names it
        self, request: pb.TriggerSnapshotRequest, context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.TriggerSnapshotResponse:
        """Makes a snapshot."""
        options = SnapshotOptions(
            pre_s=request.pre_s if request.HasField("pre_s") else None,
            post_s=request.post_s if request.HasField("post_s") else None,
            label=request.label,
            preset=request.preset,
        )
        result = await self._operations.snapshot(_request_id(request), options, _caller(context))
        return pb.TriggerSnapshotResponse(message=result.message, recording=self._recording_of(result))

    async def ListRecordings(  # noqa: N802  # the schema names it
        self, request: pb.ListRecordingsRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.ListRecordingsResponse:
        """Returns a page of the list."""
        listed: list[Manifest | BundleSummary] = [*self._status_reader.recordings, *await self._bundles.all()]
        listed.sort(key=_place, reverse=True)
        if request.page_token:
            listed = _after(listed, request.page_token)
        size = min(request.page_size or _PAGE, _LARGEST_PAGE)
        page = listed[:size]
        return pb.ListRecordingsResponse(
            recordings=[self._message(each) for each in page],
            next_page_token=_token(page[-1]) if len(listed) > size else "",
            status=mapping.status(self._status_reader, self._settings),
        )

    async def GetRecording(  # noqa: N802  # the schema names it
        self, request: pb.GetRecordingRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.GetRecordingResponse:
        """Returns a recording with a page of its files."""
        bundle = await self._bundle(request.recording_id)
        if bundle is None:
            manifest = self._status_reader.get(request.recording_id)
            return mapping.recording_page(self._status_reader, manifest, request.page_token)
        page = file_page([file.name for file in bundle.files], request.page_token)
        sums = await self._bundles.sums(bundle, [bundle.files[at] for at in page.files])
        return mapping.bundle_page(bundle, page, sums)

    async def ExportRecording(  # noqa: N802  # the schema names it
        self, request: pb.ExportRecordingRequest, context: grpc.aio.ServicerContext[Any, Any]
    ) -> AsyncIterator[pb.ExportRecordingResponse]:
        """Streams a final file."""
        bundle = await self._bundle(request.recording_id)
        async with aclosing(self._exporter.responses(request, bundle, context)) as responses:
            async for response in responses:
                yield response

    async def GetRecordingThumbnail(  # noqa: N802  # the schema names it
        self, request: pb.GetRecordingThumbnailRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.GetRecordingThumbnailResponse:
        """Returns a key frame."""
        manifest = self._status_reader.get(request.recording_id)
        folder = self._status_reader.folder_of(manifest)
        found = await self._readers.looks.run(find_thumbnail, folder, manifest)
        if found is None:
            raise NotFoundError(
                f"{manifest.id} has no key frame of video that is final", Reason.RECORDING_NOT_FOUND
            )
        return pb.GetRecordingThumbnailResponse(
            key_frame=found.key_frame, format=found.format, captured_unix_ms=found.captured_unix_ms
        )

    async def PinRecording(  # noqa: N802  # the schema names it
        self, request: pb.PinRecordingRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.PinRecordingResponse:
        """Pins a recording, or ends that."""
        await self._refuse_bundle(request.recording_id)
        result = await self._operations.pin(_request_id(request), request.recording_id, pinned=request.pinned)
        return pb.PinRecordingResponse(message=result.message, recording=self._recording_of(result))

    async def DeleteRecording(  # noqa: N802  # the schema names it
        self, request: pb.DeleteRecordingRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.DeleteRecordingResponse:
        """Deletes a recording."""
        await self._refuse_bundle(request.recording_id)
        result = await self._operations.delete(
            _request_id(request), request.recording_id, request.expected_sha256, force=request.force
        )
        return pb.DeleteRecordingResponse(message=result.message)

    async def ReportFault(  # noqa: N802  # the schema names it
        self, request: recorder_pb.ReportFaultRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> recorder_pb.ReportFaultResponse:
        """Makes an incident of a fault."""
        made = await self._operations.report_fault(request.fault_id, request.severity, request.message)
        return recorder_pb.ReportFaultResponse(recording_id=made)

    async def SetCopy(  # noqa: N802  # the schema names it
        self, request: recorder_pb.SetCopyRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> recorder_pb.SetCopyResponse:
        """Records the state of a copy."""
        await self._refuse_bundle(request.recording_id)
        await self._operations.set_copy(request.recording_id, mapping.copy(request.copy))
        return recorder_pb.SetCopyResponse()

    def _heartbeat_s(self) -> float:
        return _HEARTBEAT_WRITING_S if self._status_reader.writes else HEARTBEAT_S

    def _recording_of(self, result: Result) -> pb.Recording | None:
        return mapping.recording(self._status_reader, result.recording) if result.recording else None

    def _message(self, each: Manifest | BundleSummary) -> pb.Recording:
        if isinstance(each, BundleSummary):
            return mapping.bundle(each)
        return self._messages.of(self._status_reader, each)

    async def _bundle(self, recording_id: str) -> Bundle | None:
        return None if self._status_reader.has(recording_id) else await self._bundles.get(recording_id)

    async def _refuse_bundle(self, recording_id: str) -> None:
        if await self._bundle(recording_id):
            raise PreconditionError(
                f"{recording_id} is a folder of the robot's own experiments, which is never changed here",
                Reason.RECORDING_READ_ONLY,
            )


def _request_id(request: Any) -> str:
    """Returns the caller's ID of the request.

    Raises:
        InvalidRequestError: there is none; the gateway would have refused that.
    """
    if not request.request_id:
        raise InvalidRequestError("request_id is empty; make one for each action")
    return str(request.request_id)


def _caller(context: grpc.aio.ServicerContext[Any, Any]) -> str:
    return str(metadata(context, _CALLER))[:_LONGEST_CALLER]


def _place(each: Manifest | BundleSummary) -> tuple[int, str]:
    return each.started_unix_ms, each.id


def _token(last: Manifest | BundleSummary) -> str:
    return f"{last.started_unix_ms}.{last.id}"


def _after(listed: list[Manifest | BundleSummary], token: str) -> list[Manifest | BundleSummary]:
    """Returns those that follow on the page before, even if its last one has been deleted meanwhile."""
    instant, dot, last = token.partition(".")
    if not (dot and instant.isascii() and instant.isdigit() and last):
        raise InvalidRequestError("page_token is none that this robot has issued")
    place = (int(instant), last)
    return [each for each in listed if _place(each) < place]
