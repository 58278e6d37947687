"""PreviewService: receives, maps, calls, maps, replies."""

from collections.abc import AsyncIterator, Sequence
from typing import Any, Final

import grpc

from common.broadcast import HEARTBEAT_S
from omniseer.preview.v1 import preview_service_pb2 as pb
from omniseer.preview.v1 import preview_service_pb2_grpc as pb_grpc
from preview.encoders.catalogue import Encoder
from preview.encoders.probe import TrialProber
from preview.rpc import mapping
from preview.supervisor.supervisor import Supervisor

SERVICE: Final = pb.DESCRIPTOR.services_by_name["PreviewService"].full_name

_HEARTBEAT_WITH_PIPELINE_S: Final = 0.5


class PreviewServicer(pb_grpc.PreviewServiceServicer):
    """PreviewService.

    Args:
        supervisor: the preview.
        prober: runs the trials of encoders.
        encoders: all encoders, in order of preference.
    """

    def __init__(self, supervisor: Supervisor, prober: TrialProber, encoders: Sequence[Encoder]) -> None:
        self._supervisor = supervisor
        self._prober = prober
        self._encoders = tuple(encoders)

    def register(self, server: grpc.aio.Server) -> None:
        """Adds the methods to a server."""
        pb_grpc.add_PreviewServiceServicer_to_server(self, server)

    async def ApplyDesiredState(  # noqa: N802  # the schema names it
        self, request: pb.ApplyDesiredStateRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.ApplyDesiredStateResponse:
        """Applies a desired state; returns the actual state at that moment."""
        actual = self._supervisor.apply(mapping.desired_state(request.desired))
        return pb.ApplyDesiredStateResponse(actual=mapping.actual_state(actual))

    async def WatchActualState(  # noqa: N802  # the schema names it
        self, _request: pb.WatchActualStateRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> AsyncIterator[pb.WatchActualStateResponse]:
        """Streams the actual state, now and on every change; a slow reader skips outdated states."""
        sent = self._supervisor.actual()

        def changed() -> bool:
            return self._supervisor.actual() != sent

        with self._supervisor.watched():
            while True:
                sent = self._supervisor.actual()
                yield pb.WatchActualStateResponse(actual=mapping.actual_state(sent))
                heartbeat_s = _HEARTBEAT_WITH_PIPELINE_S if sent.stream else HEARTBEAT_S
                await self._supervisor.changes.wait_until(changed, heartbeat_s)

    async def ListEncoders(  # noqa: N802  # the schema names it
        self, _request: pb.ListEncodersRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.ListEncodersResponse:
        """Returns all encoders with the results of their trials; runs those that are still missing."""
        verdicts = [(encoder, await self._prober.verdict(encoder)) for encoder in self._encoders]
        return pb.ListEncodersResponse(encoders=[mapping.candidate(*each) for each in verdicts])

    async def RequestKeyFrame(  # noqa: N802  # the schema names it
        self, request: pb.RequestKeyFrameRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.RequestKeyFrameResponse:
        """Requests a key frame; returns without waiting for it."""
        newest_pts = request.newest_pts if request.HasField("newest_pts") else None
        return pb.RequestKeyFrameResponse(forced=self._supervisor.request_key_frame(newest_pts))

    async def ReportPictureAge(  # noqa: N802  # the schema names it
        self, request: pb.ReportPictureAgeRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.ReportPictureAgeResponse:
        """Hands the age to the adaptive bit rate."""
        self._supervisor.take_picture_age(request.age_ms)
        return pb.ReportPictureAgeResponse()
