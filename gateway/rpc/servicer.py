"""The contract's methods: receive, map, call, map, reply. Replies leave serialised."""

import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass

from common.rpc import Context
from gateway.links.preview.control import PreviewControl
from gateway.rpc.answers import Answers
from gateway.rpc.caller import Callers
from gateway.rpc.controls import Controls
from gateway.rpc.mapping.enums import least_severity_from, profile_from
from gateway.rpc.mapping.events import position_from
from gateway.rpc.mapping.info import gateway_info
from gateway.rpc.mapping.preview import preview_status
from gateway.rpc.staying import Staying
from gateway.rpc.subscribing import EventStreams
from gateway.rpc.tally import Tally
from gateway.rpc.watching import StatusWatch
from gateway.status.snapshot import Snapshot
from omniseer.gateway.v1.robot_gateway_pb2 import (
    PingResponse,
    SetPreviewModeRequest,
    SetPreviewModeResponse,
    SubscribeEventsRequest,
    WatchSystemStatusRequest,
)


@dataclass(frozen=True, slots=True)
class Streams:
    """What goes on while a caller stays.

    Attributes:
        watch: tells the status again and again.
        events: tells what happens.
        staying: notes who stays.
    """

    watch: StatusWatch
    events: EventStreams
    staying: Staying


class RobotGateway:
    """One method of the contract each; server.py binds them to their names.

    Args:
        take: makes a snapshot of this instant.
        answers: the ready answers made of such snapshots.
        preview: switches the preview.
        callers: tells who asks.
        streams: what goes on while a caller stays.
        tally: counts what is asked.
        controls: tells of control actions.
        configuration_json: as operators may see it.
    """

    def __init__(
        self,
        take: Callable[[], Snapshot],
        answers: Answers,
        preview: PreviewControl,
        callers: Callers,
        streams: Streams,
        *,
        tally: Tally,
        controls: Controls,
        configuration_json: str,
    ) -> None:
        self._take = take
        self._answers = answers
        self._preview = preview
        self._callers = callers
        self._configuration_json = configuration_json
        self.streams = streams
        self.tally = tally
        self.controls = controls

    async def get_system_status(self, _request: object, context: Context) -> bytes:
        """From memory."""
        return self._answers.system_status(self._callers.of(context.peer()))

    async def get_overlay_snapshot(self, _request: object, context: Context) -> bytes:
        """From memory."""
        return self._answers.overlay_snapshot(self._callers.of(context.peer()))

    async def get_gateway_info(self, _request: object, _context: Context) -> bytes:
        """From memory; besides `ping` the only answer that tells the calendar clock."""
        wall_clock_unix_ms = time.time_ns() // 1_000_000
        info = gateway_info(self._take(), self.tally.methods, wall_clock_unix_ms, self._configuration_json)
        return info.SerializeToString()

    async def set_preview_mode(self, request: SetPreviewModeRequest, context: Context) -> bytes:
        """Returns when the preview has settled, or when patience or the caller's deadline ends."""
        profile = profile_from(request.profile) if request.enabled else None
        message = await self._preview.set_mode(
            enabled=request.enabled, profile=profile, remaining_s=context.time_remaining()
        )
        now = self._take()
        caller = self._callers.of(context.peer())
        preview = preview_status(now.preview, now.preview_measured, caller)
        return SetPreviewModeResponse(accepted=True, message=message, preview=preview).SerializeToString()

    def watch_system_status(
        self, request: WatchSystemStatusRequest, context: Context
    ) -> AsyncIterator[bytes]:
        """From memory, until the caller leaves."""
        return self.streams.watch.statuses(request.min_interval_ms, self._callers.of(context.peer()))

    def subscribe_events(self, request: SubscribeEventsRequest, _context: Context) -> AsyncIterator[bytes]:
        """From memory, until the caller leaves."""
        after = position_from(request.after) if request.HasField("after") else None
        return self.streams.events.events(after, least_severity_from(request.min_severity))

    async def ping(self, _request: object, _context: Context) -> bytes:
        """The clocks, read as close together as Python can."""
        monotonic_ns, wall_clock_unix_ns = time.monotonic_ns(), time.time_ns()
        return PingResponse(
            monotonic_ns=monotonic_ns,
            wall_clock_unix_ns=wall_clock_unix_ns,
            boot_id=self._take().gateway.boot_id,
        ).SerializeToString()
