"""The service's methods: receive, map, call, map, reply."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import suppress
from typing import Any, Final

import grpc

from omniseer.preview.v1 import preview_service_pb2 as pb
from omniseer.preview.v1 import preview_service_pb2_grpc as pb_grpc
from preview.encoders.catalogue import Encoder
from preview.encoders.probe import Prober
from preview.rpc import mapping
from preview.supervisor import Supervisor

SERVICE: Final = pb.DESCRIPTOR.services_by_name["PreviewService"].full_name

_SIGN_OF_LIFE_S: Final = 2.0
_SIGN_OF_LIFE_WITH_PIPELINE_S: Final = 0.5


class PreviewServicer(pb_grpc.PreviewServiceServicer):
    """PreviewService.

    Args:
        manager: the preview.
        prober: the encoders' trials.
        encoders: all there are, in the order of preference.
    """

    def __init__(self, manager: Supervisor, prober: Prober, encoders: Sequence[Encoder]) -> None:
        self._manager = manager
        self._prober = prober
        self._encoders = tuple(encoders)

    def register(self, server: grpc.aio.Server) -> None:
        """Has the server offer the methods."""
        pb_grpc.add_PreviewServiceServicer_to_server(self, server)

    async def ApplyDesiredState(  # noqa: N802  # the schema names it
        self, request: pb.ApplyDesiredStateRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.ApplyDesiredStateResponse:
        """Takes the wish in."""
        status = self._manager.apply(mapping.wish(request.desired))
        return pb.ApplyDesiredStateResponse(actual=mapping.actual(status))

    async def WatchActualState(  # noqa: N802  # the schema names it
        self, _request: pb.WatchActualStateRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> AsyncIterator[pb.WatchActualStateResponse]:
        """Tells what is, now and on every change; whoever reads slowly skips what is outdated."""
        self._manager.watcher_came()
        try:
            while True:
                changed, status = self._manager.changed, self._manager.status()
                yield pb.WatchActualStateResponse(actual=mapping.actual(status))
                pause_s = _SIGN_OF_LIFE_WITH_PIPELINE_S if status.stream else _SIGN_OF_LIFE_S
                with suppress(TimeoutError):
                    await asyncio.wait_for(changed.wait(), pause_s)
        finally:
            self._manager.watcher_left()

    async def ListEncoders(  # noqa: N802  # the schema names it
        self, _request: pb.ListEncodersRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.ListEncodersResponse:
        """Tries what was not tried yet, and tells."""
        return pb.ListEncodersResponse(
            encoders=[
                mapping.candidate(encoder, await self._prober.verdict(encoder)) for encoder in self._encoders
            ]
        )
