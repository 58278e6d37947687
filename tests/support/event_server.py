"""The gateway's streams of events and status on a port of their own: things happen when a test says so.

It has a list of recordings, too, which ended long ago.
"""

import asyncio
from collections.abc import AsyncIterator
from types import TracebackType
from typing import Any, Final, Self

import grpc

from common.broadcast import Broadcast
from common.rpc import new_server
from console.client import EventPosition
from gateway.rpc.mapping.events import position_from
from gateway.rpc.responses.event_stream import EventStream
from gateway.status.event import Event, ModeChanged
from gateway.status.event_log import EventLog
from gateway.status.fault import Severity
from omniseer.gateway.v1 import recording_pb2
from omniseer.gateway.v1.robot_gateway_pb2 import (
    SubscribeEventsRequest,
    WatchSystemStatusRequest,
    WatchSystemStatusResponse,
)
from omniseer.gateway.v1.system_status_pb2 import SystemStatus
from tests.support.free import free_tcp_port

_STATUS_EVERY_S: Final = 1.0
"""As often as a gateway answers where nothing changes."""


class EventServer:
    """One port; behind it one run of the gateway after the other.

    Args:
        kept: how many events each run remembers.
        recordings: how many it lists.
        name: of its runs, to which a number is added.
    """

    def __init__(self, kept: int, recordings: int = 0, name: str = "run") -> None:
        self._name = name
        self._kept = kept
        self._recordings = recordings
        self._runs = 0
        self.port = free_tcp_port()
        self.happened: dict[str, int] = {}
        """How many events each run had."""
        self._status = SystemStatus()
        self._status_changed = Broadcast()

    @property
    def newest(self) -> EventPosition:
        """After everything that has happened."""
        return EventPosition(self._log.run_id, self._log.sequence)

    def happen(self, count: int, severity: Severity = Severity.INFO, length: int = 0) -> None:
        """So many things happen at once; their messages are at least so long."""
        for _ in range(count):
            words = f"event {self._log.sequence + 1}"
            self.note(Event(severity, "mission", words.ljust(length, "."), ModeChanged(words)))

    def note(self, event: Event) -> None:
        """This event happens."""
        self._log.add(event, 1.0)
        self._appended.notify_all()
        self.happened[self._log.run_id] = self._log.sequence

    def show(self, status: SystemStatus) -> None:
        """This is the status from now on."""
        self._status = status
        self._status_changed.notify_all()

    async def restart(self) -> None:
        """The gateway ends, and another run of it takes its place."""
        await self._server.stop(0)
        await self._start()

    async def __aenter__(self) -> Self:
        await self._start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._server.stop(0)

    async def _start(self) -> None:
        self._runs += 1
        self._log = EventLog(f"{self._name}-{self._runs}", self._kept)
        self._appended = Broadcast()
        stream = EventStream(self._log, self._appended)

        def subscribe(request: SubscribeEventsRequest, _context: Any) -> Any:
            after = position_from(request.after) if request.HasField("after") else None
            return stream.responses(after, Severity.INFO)

        handlers: dict[str, grpc.RpcMethodHandler[Any, Any]] = {
            "SubscribeEvents": grpc.unary_stream_rpc_method_handler(
                _as_generator(subscribe), SubscribeEventsRequest.FromString, None
            ),
            "WatchSystemStatus": grpc.unary_stream_rpc_method_handler(
                self._watch, WatchSystemStatusRequest.FromString, WatchSystemStatusResponse.SerializeToString
            ),
        }
        self._server = new_server()
        self._server.add_generic_rpc_handlers(
            (
                grpc.method_handlers_generic_handler("omniseer.gateway.v1.RobotGateway", handlers),
                grpc.method_handlers_generic_handler(
                    "omniseer.gateway.v1.RecordingService",
                    {
                        "ListRecordings": grpc.unary_unary_rpc_method_handler(
                            self._list,
                            recording_pb2.ListRecordingsRequest.FromString,
                            recording_pb2.ListRecordingsResponse.SerializeToString,
                        )
                    },
                ),
            )
        )
        self.port = await _bound(self._server, self.port)
        await self._server.start()

    async def _list(
        self, _request: recording_pb2.ListRecordingsRequest, _context: Any
    ) -> recording_pb2.ListRecordingsResponse:
        return recording_pb2.ListRecordingsResponse(
            recordings=[
                recording_pb2.Recording(
                    id=f"recording-{number}",
                    kind=recording_pb2.RECORDING_KIND_MANUAL,
                    state=recording_pb2.RECORDING_STATE_COMPLETE,
                    started_unix_ms=1,
                    ended_unix_ms=2,
                    size=1000,
                    file_count=1,
                )
                for number in range(self._recordings)
            ]
        )

    async def _watch(self, _request: Any, _context: Any) -> AsyncIterator[WatchSystemStatusResponse]:
        async for _ in self._status_changed.now_and_on_change(lambda: _STATUS_EVERY_S):
            yield WatchSystemStatusResponse(status=self._status)


def _as_generator(subscribe: Any) -> Any:
    async def call(request: Any, context: Any) -> Any:
        async for answer in subscribe(request, context):
            yield answer

    return call


async def _bound(server: grpc.aio.Server, port: int) -> int:
    """The port of the run before may take a moment to be free."""
    async with asyncio.timeout(10):
        while True:
            try:
                return server.add_insecure_port(f"127.0.0.1:{port}")
            except RuntimeError:
                await asyncio.sleep(0.01)
