"""The gateway put together: the only place that knows all of its parts. App, benches and tests use it.

A call passes rpc/server.py (interceptors, then services), reads state.py or asks links for a change, and is
mapped back. The board inside the state is fed by the robot's sources; faults and events follow from it at
each look.
"""

import logging
import secrets
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Final, Protocol

from common.health import Health
from common.rpc import possible_connections
from gateway.access_control import AccessControl
from gateway.config import GatewaySettings
from gateway.events import Events
from gateway.health_reporter import HealthReporter
from gateway.links.bridge.calls import BridgeCalls
from gateway.links.bridge.copies import Copies
from gateway.links.bridge.link import BridgeLink
from gateway.links.bridge.requests import HubRequestRules
from gateway.links.bridge.uploads import Uploads
from gateway.links.bridge.wire import BridgeConnector
from gateway.links.drive.commands import DriveCommands
from gateway.links.drive.model import DriveModel
from gateway.links.drive.wire import DriveConnector
from gateway.links.link import ServiceLink
from gateway.links.preview.control import PreviewControl, PreviewLink
from gateway.links.preview.exposure import ExposureLog
from gateway.links.preview.feedback import Feedback, PreviewServiceConnector
from gateway.links.preview.model import PreviewModel
from gateway.links.preview.wire import PreviewConnector
from gateway.links.reconciler import Reconciler
from gateway.links.recorder.calls import RecorderCalls
from gateway.links.recorder.incidents import Incidents
from gateway.links.recorder.link import RecorderLink
from gateway.links.recorder.wire import RecorderConnector
from gateway.metrics.bridge import BridgeMetrics
from gateway.metrics.collector import GatewayCollector
from gateway.metrics.loop_delay import LoopDelay
from gateway.metrics.recorder import RecorderMetrics
from gateway.platform.sampler import PlatformSampler
from gateway.rpc.calls.methods import SERVICES
from gateway.rpc.calls.recipient import Recipients
from gateway.rpc.connections.admission import MAX_PENDING, Admission
from gateway.rpc.connections.caller_shares import CallerShares
from gateway.rpc.connections.guard import ConnectionGuard
from gateway.rpc.connections.refusal_delay import RefusalDelay
from gateway.rpc.hub_requests import HubRequests
from gateway.rpc.interceptors.audit import Audit
from gateway.rpc.interceptors.caller_limit import CallerLimit
from gateway.rpc.interceptors.presence import Presence
from gateway.rpc.interceptors.rate_limit import RateLimit
from gateway.rpc.interceptors.stats import Stats
from gateway.rpc.interceptors.turns import Turns
from gateway.rpc.interceptors.validation import Validation
from gateway.rpc.responses.event_stream import EventStream
from gateway.rpc.responses.export_stream import ExportStream
from gateway.rpc.responses.response_cache import ResponseCache
from gateway.rpc.responses.status_stream import StatusStream
from gateway.rpc.server import SERVICE, Interceptors, Services
from gateway.rpc.services.events import EventsService
from gateway.rpc.services.info import InfoService
from gateway.rpc.services.preview import PreviewService
from gateway.rpc.services.recording import RecordingService
from gateway.rpc.services.status import StatusService
from gateway.rpc.services.teleop import TeleopService
from gateway.shown_settings import shown_settings
from gateway.state import State
from gateway.status.board import Board
from gateway.status.snapshot import Snapshot
from gateway.teleop.episodes import Episodes
from gateway.teleop.teleop import Teleop

_log = logging.getLogger(__name__)

_BESIDE_PLACES: Final = 2 * MAX_PENDING
"""Accepted connections: pending ones, and surplus ones for the moment until they are closed."""
_DRIVE_SILENCE_S: Final = 1.5
"""The drive program reports twice a second at least. One that is frozen moves nothing: its guard ends it."""
_PASSPHRASE_BYTES: Final = 24
"""32 characters of base64: 192 random bits, beyond guessing whatever the length of SRT's AES key."""


class Outside(Protocol):
    """What the gateway reads from and speaks to, besides its operators."""

    def feeding(self, board: Board) -> AbstractContextManager[None]:
        """Writes the robot's values to the board while the block lasts."""

    def preview_connector(self) -> PreviewServiceConnector:
        """Returns what opens connections to the preview service."""


class SnapshotSubscriber(Protocol):
    """What follows each look at the robot, five times a second and at each change of the preview."""

    def take(self, now: Snapshot) -> None:
        """Takes the snapshot of this instant. Never waits."""


@dataclass(frozen=True, slots=True)
class Preview:
    """What watches the preview service, requests its state, and passes on what viewers report."""

    link: PreviewLink
    control: PreviewControl
    feedback: Feedback


@dataclass(frozen=True, slots=True)
class Recording:
    """What watches the recorder, passes calls on, and reports incidents."""

    link: RecorderLink
    calls: RecorderCalls
    incidents: Incidents

    def take(self, now: Snapshot) -> None:
        """Takes the faults of this instant."""
        self.incidents.take(now.faults)


@dataclass(frozen=True, slots=True)
class Cloud:
    """What watches the bridge, passes calls on, and carries out what the hub may request.

    Attributes:
        copies: None where the robot is not set up for recording.
    """

    link: BridgeLink
    uploads: Uploads
    copies: Copies | None
    hub_requests: HubRequests

    def take(self, now: Snapshot) -> None:
        """Takes the copies of this instant."""
        if self.copies and now.cloud:
            self.copies.take(now.cloud, now.recorder)


@dataclass(frozen=True, slots=True)
class Gateway:
    """All parts that run; app.py starts and stops them.

    Attributes:
        subscribers: take each snapshot, in this order.
    """

    settings: GatewaySettings
    outside: Outside
    max_connections: int
    events: Events
    state: State
    subscribers: tuple[SnapshotSubscriber, ...]
    preview_link: PreviewLink
    teleop: Teleop | None
    recording: Recording | None
    cloud: Cloud | None
    access: AccessControl
    status_stream: StatusStream
    services: Services
    interceptors: Interceptors
    health: Health
    connection_guard: ConnectionGuard
    loop_delay: LoopDelay
    metrics: GatewayCollector


def build(settings: GatewaySettings, outside: Outside) -> Gateway:
    """Returns a gateway of which nothing runs yet.

    Raises:
        UserError: credentials or certificates can't be read.
    """
    # Milliseconds since the computer's start: a later gateway's revisions exceed an earlier one's.
    first_revision = time.clock_gettime_ns(time.CLOCK_BOOTTIME) // 1_000_000
    preview = _preview(settings, outside, first_revision)
    stats = Stats([name for service in SERVICES for name in service.methods_by_name])
    events = Events()
    addresses = 2 if settings.grpc.socket else 1
    max_connections = possible_connections(settings.limits.connections + _BESIDE_PLACES, addresses)
    admission = Admission(settings.limits, max_connections=max_connections)
    refusals = RefusalDelay()
    connection_guard = ConnectionGuard(admission)
    access = AccessControl(settings.security, events, preview.control, admission, refusals)
    recipients = Recipients(settings.preview.advertised_host)
    teleop = _teleop(settings, preview.link, access.audit, first_revision)
    recording = _recording(settings)
    cloud = _cloud(settings, recording, access.audit)
    state = State(
        settings,
        events=events,
        preview=preview.link,
        access=access,
        calls=stats,
        teleop=teleop,
        recorder=recording.link if recording else None,
        cloud=cloud.link if cloud else None,
    )
    exports = ExportStream()
    status_stream = StatusStream(state, time.monotonic)
    event_stream = EventStream(events.log, events.added)
    services = Services(
        status=StatusService(ResponseCache(state, time.monotonic), status_stream, recipients),
        preview=PreviewService(preview.control, preview.feedback, state, recipients),
        events=EventsService(event_stream),
        info=InfoService(state, stats, shown_settings(settings)),
        teleop=TeleopService(teleop, state, legacy_clients=settings.teleop.legacy_clients),
        recording=RecordingService(
            recording.calls if recording else None,
            exports,
            cloud.uploads if cloud else None,
            cloud.link if cloud else None,
        ),
    )
    interceptors = Interceptors(
        stats=stats,
        turns=Turns(admission),
        rate_limit=RateLimit(admission, refusals, admits=access.auth is None),
        audit=access.audit,
        caller_limit=CallerLimit(CallerShares(settings.limits), admission, refusals),
        auth=access.auth,
        validation=Validation(settings.limits.request_bytes),
        presence=Presence(events),
    )
    loop_delay = LoopDelay()
    health = Health(SERVICE)
    subscribers = (HealthReporter(health, state.board), ExposureLog(settings), recording, cloud)
    return Gateway(
        settings=settings,
        outside=outside,
        max_connections=max_connections,
        events=events,
        state=state,
        subscribers=tuple(each for each in subscribers if each),
        preview_link=preview.link,
        teleop=teleop,
        recording=recording,
        cloud=cloud,
        access=access,
        status_stream=status_stream,
        services=services,
        interceptors=interceptors,
        health=health,
        connection_guard=connection_guard,
        loop_delay=loop_delay,
        metrics=GatewayCollector(
            state=state,
            stats=stats,
            loop_delay=loop_delay,
            connection_guard=connection_guard,
            status_stream=status_stream,
            event_stream=event_stream,
            preview_link=preview.link,
            drive_link=teleop.link if teleop else None,
            recorder=RecorderMetrics(recording.link, recording.incidents, exports) if recording else None,
            bridge=BridgeMetrics(cloud.link, cloud.copies, cloud.hub_requests) if cloud else None,
        ),
    )


def _preview(settings: GatewaySettings, outside: Outside, first_revision: int) -> Preview:
    """Returns what speaks to the preview service."""
    model = PreviewModel(settings.encrypts_preview, partial(secrets.token_urlsafe, _PASSPHRASE_BYTES))
    feedback = Feedback(outside.preview_connector())
    name = f"preview service at {settings.preview.socket}"
    link = ServiceLink(name, feedback, Reconciler(first_revision, model))
    return Preview(link, PreviewControl(link, settings.preview.settle_ms / 1000), feedback)


def _teleop(
    settings: GatewaySettings, preview: PreviewLink, audit: Audit, first_revision: int
) -> Teleop | None:
    """Returns what drives the robot; None where it is not set up for that."""
    driving = settings.teleop
    if driving.socket is None:
        return None
    episodes = Episodes(audit)
    commands = DriveCommands(DriveConnector(driving.socket, episodes.record))
    model = DriveModel(enabled_at_start=driving.enabled_at_start)
    link = ServiceLink(
        f"drive program at {driving.socket}",
        commands,
        Reconciler(first_revision, model),
        silence_s=_DRIVE_SILENCE_S,
        apply_deadline_s=_DRIVE_SILENCE_S,
    )
    return Teleop(
        link,
        commands,
        preview,
        line_of_sight=driving.line_of_sight,
        episodes=episodes,
    )


def _recording(settings: GatewaySettings) -> Recording | None:
    """Returns what speaks to the recorder; None where the robot is not set up for recording."""
    socket = settings.recording.socket
    if socket is None:
        return None
    calls = RecorderCalls(RecorderConnector(socket))
    return Recording(RecorderLink(f"recorder at {socket}", calls), calls, Incidents(calls))


def _cloud(settings: GatewaySettings, recording: Recording | None, audit: Audit) -> Cloud | None:
    """Returns what speaks to the bridge; None where the robot is not set up for a fleet."""
    bridge = settings.bridge
    if bridge.socket is None:
        return None
    calls = BridgeCalls(BridgeConnector(bridge.socket))
    link = BridgeLink(f"bridge at {bridge.socket}", calls)
    copies = Copies(recording.calls) if recording else None
    uploads = Uploads(calls, copies)
    hub_requests = HubRequests(
        link=link,
        calls=calls,
        uploads=uploads,
        recorder=recording.calls if recording else None,
        rules=HubRequestRules(bridge.allowed_requests, time.monotonic()),
        audit=audit,
    )
    return Cloud(link, uploads, copies, hub_requests)


@dataclass(frozen=True, slots=True)
class ThisRobot:
    """The robot that the gateway runs on: its ROS graph, its computer, its preview service."""

    settings: GatewaySettings

    @contextmanager
    def feeding(self, board: Board) -> Iterator[None]:
        """Samples ROS and the computer while the block lasts. A gateway without sources needs no ROS."""
        with PlatformSampler(self.settings.platform, board):
            if not self.settings.sources:
                _log.info("no sources are configured; ROS is not used")
                yield
                return
            # Late: a gateway without sources runs where ROS is not installed.
            from gateway.ros.intake import intake  # noqa: PLC0415

            with intake(self.settings.sources, board):
                yield

    def preview_connector(self) -> PreviewConnector:
        """Returns a connector to the configured socket."""
        return PreviewConnector(self.settings.preview.socket)
