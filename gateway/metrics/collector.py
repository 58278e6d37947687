"""The metrics by name. docs/metrics.md explains each; a test holds the page and this folder together."""

from collections.abc import Iterator
from dataclasses import dataclass

from prometheus_client.core import Metric

from common.collector import InstantCollector
from gateway.links.drive.state import DriveLink
from gateway.links.preview.control import PreviewLink
from gateway.metrics.bridge import BridgeMetrics, of_cloud
from gateway.metrics.calls import of_calls, of_connections, of_event_loop, of_streams
from gateway.metrics.drive import of_driving
from gateway.metrics.loop_delay import LoopDelay
from gateway.metrics.preview import of_preview
from gateway.metrics.recorder import RecorderMetrics, of_recording
from gateway.metrics.robot import of_robot
from gateway.rpc.calls.ports import SnapshotSource
from gateway.rpc.connections.guard import ConnectionGuard
from gateway.rpc.interceptors.stats import Stats
from gateway.rpc.responses.event_stream import EventStream
from gateway.rpc.responses.status_stream import StatusStream


@dataclass(eq=False)
class GatewayCollector(InstantCollector):
    """Collects all metrics at one instant.

    Attributes:
        state: where the gauges come from.
        stats: of the calls.
        loop_delay: how late the event loop was.
        status_stream: counts responses that slow readers skipped.
        event_stream: counts gaps of subscribers.
        connection_guard: counts connections.
        preview_link: counts failures to connect.
        drive_link: counts failures to connect; None where the robot is not set up for driving.
        recorder: counts recording; None where the robot is not set up for it.
        bridge: counts what concerns the fleet; None where the robot is not set up for one.
    """

    state: SnapshotSource
    stats: Stats
    loop_delay: LoopDelay
    connection_guard: ConnectionGuard
    status_stream: StatusStream
    event_stream: EventStream
    preview_link: PreviewLink
    drive_link: DriveLink | None = None
    recorder: RecorderMetrics | None = None
    bridge: BridgeMetrics | None = None

    def collect(self) -> Iterator[Metric]:
        """Yields every family."""
        now = self.state.snapshot()
        yield from of_robot(now)
        yield from of_calls(self.stats)
        yield of_event_loop(self.loop_delay)
        yield from of_streams(self.stats, self.status_stream, self.event_stream)
        yield from of_connections(self.connection_guard)
        yield from of_preview(now, self.preview_link.failures)
        if now.teleop and self.drive_link:
            yield from of_driving(now.teleop, self.drive_link.failures)
        if now.recorder and self.recorder:
            yield from of_recording(now.recorder, self.recorder)
        if now.cloud and self.bridge:
            yield from of_cloud(now.cloud, now.at_s, self.bridge)
