"""The contract's methods: receive, map, call, map, reply. Replies leave serialised."""

import time
from collections.abc import Callable

from common.rpc import Context
from gateway.preview_link.control import PreviewControl
from gateway.rpc.answers import Answers
from gateway.rpc.caller import Callers
from gateway.rpc.mapping.enums import profile_from
from gateway.rpc.mapping.info import gateway_info
from gateway.rpc.mapping.preview import preview_status
from gateway.rpc.tally import Tally
from gateway.status.snapshot import Snapshot
from omniseer.gateway.v1.robot_gateway_pb2 import SetPreviewModeRequest, SetPreviewModeResponse


class RobotGateway:
    """One method of the contract each; server.py binds them to their names.

    Args:
        take: makes a snapshot of this instant.
        answers: the ready answers made of such snapshots.
        preview: switches the preview.
        callers: tells who asks.
        tally: counts what is asked.
        configuration_json: as operators may see it.
    """

    def __init__(
        self,
        take: Callable[[], Snapshot],
        answers: Answers,
        preview: PreviewControl,
        callers: Callers,
        *,
        tally: Tally,
        configuration_json: str,
    ) -> None:
        self._take = take
        self._answers = answers
        self._preview = preview
        self._callers = callers
        self._configuration_json = configuration_json
        self.tally = tally

    async def get_system_status(self, _request: object, context: Context) -> bytes:
        """From memory."""
        return self._answers.system_status(self._callers.of(context.peer()))

    async def get_overlay_snapshot(self, _request: object, context: Context) -> bytes:
        """From memory."""
        return self._answers.overlay_snapshot(self._callers.of(context.peer()))

    async def get_gateway_info(self, _request: object, _context: Context) -> bytes:
        """From memory; the only answer that tells the calendar clock."""
        wall_clock_unix_ms = time.time_ns() // 1_000_000
        info = gateway_info(self._take(), self.tally.methods, wall_clock_unix_ms, self._configuration_json)
        return info.SerializeToString()

    async def set_preview_mode(self, request: SetPreviewModeRequest, context: Context) -> bytes:
        """Returns when the preview has settled, or when patience or the caller's deadline ends."""
        profile = profile_from(request.profile) if request.enabled else None
        message = await self._preview.switch(
            enabled=request.enabled, profile=profile, remaining_s=context.time_remaining()
        )
        now = self._take()
        caller = self._callers.of(context.peer())
        preview = preview_status(now.preview, now.preview_measured, caller)
        return SetPreviewModeResponse(accepted=True, message=message, preview=preview).SerializeToString()
