"""Everything the gateway knows: written by its parts, read as one snapshot."""

import time
from typing import Protocol

from common.boot import boot_id
from common.version import project_revision, project_version
from gateway.config import GatewaySettings
from gateway.events import Events
from gateway.observer import Observer
from gateway.status.access import AccessView
from gateway.status.board import Board
from gateway.status.cloud import CloudView
from gateway.status.faults.rules import FaultRules
from gateway.status.faults.tracker import FaultTracker
from gateway.status.pictures import NO_PICTURES, PictureReport, PictureReports, Pictures
from gateway.status.preview import PreviewView
from gateway.status.recording import RecorderView
from gateway.status.snapshot import Identity, Noted, Programs, Runtime, Setup, Snapshot, take
from gateway.status.teleop import TeleopView


class PreviewSource(Protocol):
    """What has the view of the preview."""

    @property
    def view(self) -> PreviewView:
        """The preview at this instant; a new object whenever it changed."""


class AccessSource(Protocol):
    """What has the view of access control."""

    def view(self) -> AccessView:
        """Returns credentials and audit log at this instant, from memory."""


class CallCounts(Protocol):
    """What counts the operators' calls."""

    @property
    def served(self) -> int:
        """Calls that were answered since the start."""

    @property
    def refused(self) -> int:
        """Calls that were refused since the start."""

    def client_count(self) -> int:
        """Returns how many clients call at present."""


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
        events: where the events go that follow from what is observed.
        preview: has the view of the preview.
        access: has the view of credentials and audit log.
        calls: counts the operators' calls.
        teleop: has the view of driving; None where the robot is not set up for it.
        recorder: has the view of recording; None as above.
        cloud: has the view of the connection to the fleet; None as above.

    Attributes:
        board: the values of the robot.
    """

    def __init__(
        self,
        settings: GatewaySettings,
        *,
        events: Events,
        preview: PreviewSource,
        access: AccessSource,
        calls: CallCounts,
        teleop: TeleopSource | None,
        recorder: RecorderSource | None,
        cloud: CloudSource | None,
    ) -> None:
        faults = settings.faults
        insecure = settings.security.insecure and not settings.security.guarded
        self._setup = Setup(Identity(settings.name, project_version(), insecure), settings.status_rules())
        self._events = events
        self._preview = preview
        self._access = access
        self._calls = calls
        self._teleop, self._recorder, self._cloud = teleop, recorder, cloud
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
        self._pictures = PictureReports()
        self.board = Board()

    @property
    def preview(self) -> PreviewView:
        """The preview at this instant; a new object whenever it changed."""
        return self._preview.view

    @property
    def ros_passed_s(self) -> float | None:
        """When the newest pass of the ROS sampler ended, as `Board.ros_passed_s`."""
        return self.board.ros_passed_s

    def snapshot(self) -> Snapshot:
        """Returns everything at this instant, from memory."""
        now_s = time.monotonic()
        programs = Programs(
            preview=self._preview.view,
            teleop=self._teleop.view() if self._teleop else None,
            recorder=self._recorder.view if self._recorder else None,
            cloud=self._cloud.view if self._cloud else None,
        )
        noted = Noted(
            events=self._events.log.newest(),
            faults=self._tracker.faults,
            gateway=self._runtime(now_s),
            access=self._access.view(),
            pictures=self._counting_pictures(now_s),
        )
        return take(self._setup, self.board, programs, now_s, noted)

    def observe(self) -> Snapshot:
        """Updates faults and events from a snapshot of this instant, and returns that."""
        now = self.snapshot()
        for event in self._observer.observe(now):
            self._events.note(event)
        return now

    def take_picture(self, caller: str, viewer_id: str, report: PictureReport) -> Pictures:
        """Takes a viewer's report of this instant; returns what all say that count now."""
        now_s = time.monotonic()
        self._pictures.take(caller, viewer_id, report, now_s)
        return self._counting_pictures(now_s)

    def _counting_pictures(self, now_s: float) -> Pictures:
        """Without a viewer on the stream no report counts: it is of no picture of this robot."""
        measured = self._preview.view.measured
        return self._pictures.counting(now_s) if measured and measured.value.viewer_count else NO_PICTURES

    def _runtime(self, now_s: float) -> Runtime:
        return Runtime(
            revision=self._revision,
            boot_id=self._boot_id,
            uptime_ms=int((now_s - self._started_s) * 1000),
            client_count=self._calls.client_count(),
            requests_served=self._calls.served,
            requests_refused=self._calls.refused,
            run_id=self._events.log.run_id,
        )
