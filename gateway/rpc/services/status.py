"""The robot's status: polled or watched, with detections and recent events where a picture is drawn over."""

from collections.abc import AsyncIterator

from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.recipient import Recipients
from gateway.rpc.mapping.status import overlay_snapshot, system_status
from gateway.rpc.responses.response_cache import ResponseCache
from gateway.rpc.responses.status_stream import StatusStream
from omniseer.gateway.v1.robot_gateway_pb2 import (
    GetOverlaySnapshotRequest,
    GetSystemStatusRequest,
    WatchSystemStatusRequest,
)


class StatusService:
    """Answers from memory, and never waits for ROS or the preview.

    Args:
        responses: of the polled methods.
        stream: of the watched one.
        recipients: finds out what a caller may see.
    """

    def __init__(self, responses: ResponseCache, stream: StatusStream, recipients: Recipients) -> None:
        self._responses = responses
        self._stream = stream
        self._recipients = recipients

    async def get_system_status(self, _request: GetSystemStatusRequest, call: CallContext) -> bytes:
        """Returns a SystemStatus, serialised."""
        return self._responses.response(system_status, self._recipients.of(call))

    async def get_overlay_snapshot(self, _request: GetOverlaySnapshotRequest, call: CallContext) -> bytes:
        """Returns an OverlaySnapshot, serialised."""
        return self._responses.response(overlay_snapshot, self._recipients.of(call))

    def watch_system_status(
        self, request: WatchSystemStatusRequest, call: CallContext
    ) -> AsyncIterator[bytes]:
        """Yields WatchSystemStatusResponses, serialised, until the caller leaves."""
        return self._stream.responses(
            request.min_interval_ms,
            self._recipients.of(call),
            with_detections=request.include_detections,
        )
