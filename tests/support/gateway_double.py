"""A gateway for the operator's side to talk to: a real gRPC server whose answers the test writes.

It keeps the contract's behaviour of the preview; tests/contract holds the real gateway to the same.
"""

import threading
import time
from collections import deque
from collections.abc import Iterator
from concurrent import futures
from contextlib import contextmanager
from typing import Any, Never

import grpc

from omniseer.gateway.v1 import (
    overlay_pb2,
    preview_pb2,
    robot_gateway_pb2,
    robot_gateway_pb2_grpc,
    system_status_pb2,
)
from omniseer.gateway.v1 import states_pb2 as states

STREAM_URI = "srt://127.0.0.1:7100"
_TARGETS = {
    preview_pb2.PREVIEW_PROFILE_LOW_BW: (15, 1000),
    preview_pb2.PREVIEW_PROFILE_BALANCED: (30, 2500),
    preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY: (60, 4500),
}
"""Frames per second and kbit/s."""
_HELD_AT_MOST_S = 20
_TICK_S = 0.05
_HEARTBEAT_S = 1.0


def healthy_status() -> system_status_pb2.SystemStatus:
    """A robot that drives forward and sees well."""
    status = system_status_pb2.SystemStatus(gateway_name="lab-1", gateway_version="1.2.3")
    health = status.health
    health.state, health.ready, health.summary = states.ROBOT_HEALTH_OK, True, "robot healthy"
    health.odom_available, health.odom_age_ms = True, 12
    health.linear_speed_mps = health.measured_vx_mps = 0.5
    health.angular_speed_rad_s = health.measured_wz_rad_s = 0.3
    status.vision.MergeFrom(
        system_status_pb2.VisionStatus(
            available=True, age_ms=40, producer_fps=30, consumer_fps=29.5, last_infer_ms=12.5
        )
    )
    battery = status.platform.power.lipo_battery
    battery.available, battery.present, battery.source = True, True, "traction"
    battery.percentage_available, battery.percentage = True, 78
    status.preview.state = states.PREVIEW_DISABLED
    status.preview.service_reachable = True
    return status


class GatewayDouble(robot_gateway_pb2_grpc.RobotGatewayServicer):
    """What the test may set, and what it may look at afterwards.

    Attributes:
        status: the answer to GetSystemStatus; also part of GetOverlaySnapshot.
        overlay: detections and events of the answer to GetOverlaySnapshot.
        info: the answer to GetGatewayInfo.
        accept: whether requests are accepted.
        works: whether an enabled preview comes to run; else it ends FAULTED.
        fault: why it is FAULTED, and what to do.
        failures: (code, details) pairs; each call takes one and fails with it, until none is left.
        preview_becomes: states of the preview after an enable, one for each later look at the status. When it
            is empty, an enable comes to its end at once.
        preview_answers: while cleared, the preview service behind this gateway hangs: SetPreviewMode waits,
            at most 20 s, and nothing else does so.
        hold: while cleared, calls wait (at most 20 s) before they are answered.
        calls: names of the methods called, in order.
        preview_requests: of SetPreviewMode, in order.
    """

    def __init__(self) -> None:
        self.status = healthy_status()
        self.overlay = overlay_pb2.OverlaySnapshot()
        self.info = robot_gateway_pb2.GetGatewayInfoResponse(
            gateway_name="lab-1", gateway_version="1.2.3", configuration_json='{"name": "lab-1"}'
        )
        self.failures: deque[tuple[grpc.StatusCode, str]] = deque()
        self.preview_becomes: deque[states.PreviewState.ValueType] = deque()
        self.fault = "no encoder works. Type: robot-preview encoders"
        self.accept = True
        self.works = True
        self.preview_answers = threading.Event()
        self.preview_answers.set()
        self.hold = threading.Event()
        self.hold.set()
        self.calls: list[str] = []
        self.preview_requests: list[robot_gateway_pb2.SetPreviewModeRequest] = []

    def GetSystemStatus(self, _request: Any, context: Any) -> system_status_pb2.SystemStatus:  # noqa: N802
        self._begin("GetSystemStatus", context)
        self._preview_moves_on()
        return self.status

    def GetOverlaySnapshot(self, _request: Any, context: Any) -> overlay_pb2.OverlaySnapshot:  # noqa: N802
        self._begin("GetOverlaySnapshot", context)
        self.overlay.status.CopyFrom(self.status)
        return self.overlay

    def GetGatewayInfo(  # noqa: N802
        self, _request: Any, context: Any
    ) -> robot_gateway_pb2.GetGatewayInfoResponse:
        self._begin("GetGatewayInfo", context)
        return self.info

    def SetPreviewMode(  # noqa: N802
        self, request: robot_gateway_pb2.SetPreviewModeRequest, context: Any
    ) -> robot_gateway_pb2.SetPreviewModeResponse:
        self._begin("SetPreviewMode", context)
        self.preview_requests.append(request)
        if request.enabled and request.profile not in preview_pb2.PreviewProfile.values():
            context.abort(grpc.StatusCode.INVALID_ARGUMENT, f"profile {request.profile} does not exist")
        self.preview_answers.wait(_HELD_AT_MOST_S)
        message = self._switch(request) if self.accept else "the robot is being serviced"
        return robot_gateway_pb2.SetPreviewModeResponse(
            accepted=self.accept, message=message, preview=self.status.preview
        )

    def Ping(self, _request: Any, context: Any) -> Any:  # noqa: N802
        _not_offered(context)

    def WatchSystemStatus(self, _request: Any, context: Any) -> Any:  # noqa: N802
        _not_offered(context)

    def SubscribeEvents(self, _request: Any, context: Any) -> Any:  # noqa: N802
        _not_offered(context)

    def RequestKeyFrame(self, _request: Any, context: Any) -> Any:  # noqa: N802
        _not_offered(context)

    def ReportPicture(self, _request: Any, context: Any) -> Any:  # noqa: N802
        _not_offered(context)

    def SetTeleopEnabled(self, _request: Any, context: Any) -> Any:  # noqa: N802
        _not_offered(context)

    def SendTeleopCommand(self, _request: Any, context: Any) -> Any:  # noqa: N802
        _not_offered(context)

    def preview_service_dies(self) -> None:
        """From now on nothing makes video; what is desired stays so."""
        preview = self.status.preview
        preview.service_reachable = False
        if preview.state != states.PREVIEW_DISABLED:
            self._preview_faults("preview service unreachable. Start or restart it")

    def _begin(self, name: str, context: Any) -> None:
        self.calls.append(name)
        if self.failures:
            code, details = self.failures.popleft()
            context.abort(code, details)
        self.hold.wait(_HELD_AT_MOST_S)

    def _switch(self, request: robot_gateway_pb2.SetPreviewModeRequest) -> str:
        preview = self.status.preview
        if not request.enabled:
            preview.state = states.PREVIEW_DISABLED
            return "preview is off"
        profile = request.profile or preview.profile or preview_pb2.PREVIEW_PROFILE_BALANCED
        if preview.state == states.PREVIEW_RUNNING and profile == preview.profile:
            return "preview is already running; nothing was touched"
        preview.profile = profile
        if not self.preview_becomes:
            self.preview_becomes.append(states.PREVIEW_RUNNING if self.works else states.PREVIEW_FAULTED)
        self._preview_moves_on()
        if preview.state == states.PREVIEW_FAULTED:
            return f"preview is not delivering yet: {preview.last_error}"
        return "preview is running" if preview.state == states.PREVIEW_RUNNING else "preview is on its way"

    def _preview_moves_on(self) -> None:
        if not self.preview_becomes:
            return
        preview, before = self.status.preview, self.status.preview.state
        state = self.preview_becomes.popleft()
        if state == states.PREVIEW_FAULTED:
            self._preview_faults(self.fault)
            return
        preview.state, preview.last_error = state, ""
        if state == states.PREVIEW_RUNNING:
            preview.counters.starts += before != states.PREVIEW_RUNNING
            _describe_stream(preview)

    def _preview_faults(self, why: str) -> None:
        preview = self.status.preview
        preview.state, preview.last_error = states.PREVIEW_FAULTED, why
        preview.counters.faults += 1


def _not_offered(context: grpc.ServicerContext) -> Never:
    """A gateway of the first release: clients poll the status instead of watching it."""
    context.abort(grpc.StatusCode.UNIMPLEMENTED, "Method not implemented!")


class StreamingGatewayDouble(GatewayDouble):
    """A present gateway: it streams its status with detections, and answers pings and viewers.

    Attributes:
        key_frames_requested: every request for one.
        pictures: every report of a viewer.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.key_frames_requested: list[robot_gateway_pb2.RequestKeyFrameRequest] = []
        self.pictures: list[robot_gateway_pb2.ReportPictureRequest] = []

    def WatchSystemStatus(  # noqa: N802
        self, request: robot_gateway_pb2.WatchSystemStatusRequest, context: Any
    ) -> Iterator[robot_gateway_pb2.WatchSystemStatusResponse]:
        ended = threading.Event()
        context.add_callback(ended.set)
        self._begin("WatchSystemStatus", context)
        sent, sent_s = None, 0.0
        while not ended.is_set():
            self.hold.wait(_HELD_AT_MOST_S)
            newest = robot_gateway_pb2.WatchSystemStatusResponse(status=self.status)
            if request.include_detections:
                newest.detections.CopyFrom(self.overlay.detections)
            if newest != sent or time.monotonic() - sent_s >= _HEARTBEAT_S:
                sent, sent_s = newest, time.monotonic()
                yield newest
            ended.wait(max(request.min_interval_ms / 1000, _TICK_S))

    def Ping(self, _request: Any, context: Any) -> robot_gateway_pb2.PingResponse:  # noqa: N802
        self._begin("Ping", context)
        return robot_gateway_pb2.PingResponse(
            monotonic_ns=time.monotonic_ns(), wall_clock_unix_ns=time.time_ns(), boot_id="double"
        )

    def RequestKeyFrame(self, request: Any, context: Any) -> Any:  # noqa: N802
        self._begin("RequestKeyFrame", context)
        self.key_frames_requested.append(request)
        return robot_gateway_pb2.RequestKeyFrameResponse(forced=True)

    def ReportPicture(self, request: Any, context: Any) -> Any:  # noqa: N802
        self._begin("ReportPicture", context)
        self.pictures.append(request)
        return robot_gateway_pb2.ReportPictureResponse()


def _describe_stream(preview: preview_pb2.PreviewStatus) -> None:
    preview.endpoint.MergeFrom(
        preview_pb2.StreamEndpoint(
            transport=preview_pb2.STREAM_TRANSPORT_SRT,
            host="127.0.0.1",
            port=7100,
            uri=STREAM_URI,
            latency_ms=125,
            codec=preview_pb2.VIDEO_CODEC_H264,
            container=preview_pb2.STREAM_CONTAINER_MPEG_TS,
        )
    )
    preview.encoder.name = preview.encoder.wanted = "x264"
    fps, preview.target_bitrate_kbps = _TARGETS[preview.profile or preview_pb2.PREVIEW_PROFILE_BALANCED]
    preview.video.width_px, preview.video.height_px, preview.video.fps = 1280, 720, fps


@contextmanager
def serving(double: GatewayDouble, port: int = 0, *more: grpc.GenericRpcHandler) -> Iterator[int]:
    """Serves the double and `more` on 127.0.0.1; yields the port. Pings are allowed as by the real one."""
    with _server(port) as (server, bound):
        robot_gateway_pb2_grpc.add_RobotGatewayServicer_to_server(double, server)
        server.add_generic_rpc_handlers(more)
        server.start()
        try:
            yield bound
        finally:
            double.hold.set()
            double.preview_answers.set()


@contextmanager
def serving_handlers(*handlers: grpc.GenericRpcHandler) -> Iterator[int]:
    """Serves other handlers in the same way."""
    with _server(0) as (server, bound):
        server.add_generic_rpc_handlers(handlers)
        server.start()
        yield bound


@contextmanager
def _server(port: int) -> Iterator[tuple[grpc.Server, int]]:
    workers = futures.ThreadPoolExecutor(max_workers=8)
    server = grpc.server(
        workers,
        options=[
            ("grpc.so_reuseport", 0),
            ("grpc.keepalive_permit_without_calls", 1),
            ("grpc.http2.min_ping_interval_without_data_ms", 1_000),
        ],
    )
    bound = server.add_insecure_port(f"127.0.0.1:{port}")
    try:
        yield server, bound
    finally:
        server.stop(0).wait(10)
        workers.shutdown()
