"""Everything the gateway knows: written by its parts, read as one snapshot."""

import logging
import secrets
import time
from typing import Final, Protocol

from common.boot import boot_id
from common.broadcast import Broadcast
from common.version import project_revision, project_version
from gateway.config import GatewaySettings
from gateway.links.preview.control import PreviewLink
from gateway.observer import Observer
from gateway.rpc.interceptors.stats import Stats
from gateway.status.access import UNGUARDED, AccessView
from gateway.status.board import Board
from gateway.status.cloud import CloudView
from gateway.status.event import Event
from gateway.status.event_log import EventLog
from gateway.status.faults.rules import FaultRules
from gateway.status.faults.tracker import FaultTracker
from gateway.status.pictures import NO_PICTURES, PictureReport, PictureReports, Pictures
from gateway.status.preview import PreviewView
from gateway.status.recording import RecorderView
from gateway.status.snapshot import Identity, Runtime, Snapshot, take
from gateway.status.teleop import TeleopView

_log = logging.getLogger(__name__)

_RUN_ID_BYTES: Final = 8


class TeleopSource(Protocol):
    """What has the view of driving."""

    def view(self) -> TeleopView:
        """Returns driving at this instant, from memory."""


class RecorderSource(Protocol):
    """What has the view of the recorder."""

    @property
    def view(self) -> RecorderView:
        """The recorder at this instant, from memory."""


class CloudSource(Protocol):
    """What has the view of the bridge."""

    @property
    def view(self) -> CloudView:
        """The bridge at this instant, from memory."""


class State:
    """The board, the events and the faults. Used on the event loop; other threads write to the board only.

    Args:
        settings: what is expected of the robot.
        preview_link: has the view of the preview.
        stats: counts the calls.

    Attributes:
        event_added: notified after each event.
        access: of the newest look at it.
        teleop: has the view of driving; None where the robot is not set up for it.
        recorder: the same of recording.
        cloud: the same of the connection to the fleet.
    """

    def __init__(self, settings: GatewaySettings, preview_link: PreviewLink, stats: Stats) -> None:
        faults = settings.faults
        self._identity = Identity(
            settings.name, project_version(), settings.security.insecure and not settings.security.guarded
        )
        self._rules = settings.status_rules()
        self._preview_link = preview_link
        self._stats = stats
        self._revision, self._boot_id = project_revision(), boot_id()
        self._started_s = time.monotonic()
        self._tracker = FaultTracker(faults.clear_after_ms / 1000, faults.keep_cleared_ms / 1000)
        self._observer = Observer(
            self._tracker,
            FaultRules(
                faults.platform_limits(),
                faults.startup_grace_ms / 1000,
                faults.expiry_days,
                faults.hub_offline_s,
            ),
        )
        self.board, self.events = Board(), EventLog(secrets.token_hex(_RUN_ID_BYTES))
        self.event_added = Broadcast()
        self._pictures = PictureReports()
        self.access: AccessView = UNGUARDED
        self.teleop: TeleopSource | None = None
        self.recorder: RecorderSource | None = None
        self.cloud: CloudSource | None = None

    @property
    def preview(self) -> PreviewView:
        """The preview at this instant; a new object whenever it changed."""
        return self._preview_link.view

    def snapshot(self) -> Snapshot:
        """Returns everything at this instant, from memory."""
        now_s = time.monotonic()
        return take(
            identity=self._identity,
            gateway=self._runtime(now_s),
            rules=self._rules,
            board=self.board,
            preview=self._preview_link.view,
            pictures=self._counting_pictures(now_s),
            events=self.events.newest(),
            faults=self._tracker.faults,
            now_s=now_s,
            access=self.access,
            teleop=self.teleop.view() if self.teleop else None,
            recorder=self.recorder.view if self.recorder else None,
            cloud=self.cloud.view if self.cloud else None,
        )

    def observe(self, access: AccessView) -> Snapshot:
        """Updates faults and events from a snapshot of this instant, and returns that.

        Args:
            access: the state of credentials and audit log at this instant.
        """
        self.access = access
        now = self.snapshot()
        for event in self._observer.observe(now):
            self.note(event)
        return now

    def note(self, event: Event) -> None:
        """Adds an event of this instant."""
        _log.info("event: %s", event.sentence or event.message)
        self.events.add(event, time.monotonic())
        self.event_added.notify_all()

    def take_picture(self, caller: str, viewer_id: str, report: PictureReport) -> Pictures:
        """Takes a viewer's report of this instant; returns what all say that count now."""
        now_s = time.monotonic()
        self._pictures.take(caller, viewer_id, report, now_s)
        return self._counting_pictures(now_s)

    def _counting_pictures(self, now_s: float) -> Pictures:
        """Without a viewer on the stream no report counts: it is of no picture of this robot."""
        measured = self._preview_link.view.measured
        return self._pictures.counting(now_s) if measured and measured.value.viewer_count else NO_PICTURES

    def _runtime(self, now_s: float) -> Runtime:
        return Runtime(
            revision=self._revision,
            boot_id=self._boot_id,
            uptime_ms=int((now_s - self._started_s) * 1000),
            client_count=self._stats.client_count(),
            requests_served=self._stats.served,
            requests_refused=self._stats.refused,
            run_id=self.events.run_id,
        )
