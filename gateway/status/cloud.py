"""The robot's fleet: what the bridge reports, and what operators see of it.

Instants ending in `_s` are seconds of the monotonic clock.
"""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from gateway.status.freshness import age_ms
from gateway.status.values import Received


class CloudState(Enum):
    """State of the connection to the fleet's hub."""

    OFFLINE = "offline"
    CONNECTED = "connected"
    REFUSED = "refused"
    """The hub refuses the robot's credential."""
    FAULTED = "faulted"
    """The bridge can't work."""
    UNREACHABLE = "unreachable"
    """Found by the gateway; the bridge reports all others."""


class RecordingCopyState(Enum):
    """Whether a recording is kept elsewhere, too."""

    UNSPECIFIED = "none"
    """No copy is wanted."""
    QUEUED = "queued"
    UPLOADING = "uploading"
    VERIFYING = "verifying"
    VERIFIED = "verified"
    PAUSED = "paused"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class RecordingCopy:
    """The copy of a recording; see RecordingCopy in recording.proto."""

    state: RecordingCopyState
    reason: str = ""
    bytes_done: int = 0


@dataclass(frozen=True, slots=True)
class CopyReport:
    """The copy of one recording.

    Attributes:
        since_s: since when it is in its state; None where that was before the bridge started.
    """

    recording_id: str
    copy: RecordingCopy
    since_s: float | None = None


class HubAction(Enum):
    """What the hub may request, where the configuration allows it. There is nothing else."""

    UPLOAD = "upload"
    SNAPSHOT = "snapshot"


@dataclass(frozen=True, slots=True)
class HubRequest:
    """A request of the hub, as the bridge passes it on; see HubRequest in bridge_service.proto.

    Attributes:
        request_id: names it for ever.
        issued_by: by the hub's word; printable ASCII.
        expires_s: when it may not be begun any more.
        action: None for one that this gateway does not know.
        recording_id: of an upload.
        pre_s, post_s: of a snapshot; None as configured.
        label: of a snapshot.
    """

    request_id: str
    issued_by: str
    expires_s: float
    action: HubAction | None
    recording_id: str = ""
    pre_s: int | None = None
    post_s: int | None = None
    label: str = ""


@dataclass(frozen=True, slots=True)
class CloudStatus:
    """The connection to the fleet as operators see it; see CloudStatus in cloud.proto.

    Attributes:
        last_sent_age_ms: None before the first acknowledgement.
        uploading: None while nothing is copied.
    """

    state: CloudState
    robot: str = ""
    fleet: str = ""
    state_age_ms: int = 0
    outbox_events: int = 0
    outbox_bytes: int = 0
    outbox_max_bytes: int = 0
    events_dropped: int = 0
    events_sent: int = 0
    last_sent_age_ms: int | None = None
    uploads_waiting: int = 0
    uploading_id: str = ""
    uploading: RecordingCopy | None = None
    uploading_size: int = 0
    upload_bytes_per_s: int = 0
    uploads_paused: str = ""
    last_error: str = ""
    uploads_left_out: int = 0


@dataclass(frozen=True, slots=True)
class NotTaken:
    """What the bridge has not taken of all that the hub has sent; see NotTaken in bridge_service.proto."""

    unreadable: int = 0
    dropped: int = 0
    strays: int = 0
    denied: int = 0


@dataclass(frozen=True, slots=True)
class Retries:
    """What has failed in the bridge and is tried again; see Retries in bridge_service.proto."""

    hub: int = 0
    state: int = 0
    disk: int = 0
    gateway: int = 0
    upload: int = 0


@dataclass(frozen=True, slots=True)
class BridgeReport:
    """The state of the bridge at one instant; see bridge_service.proto.

    Attributes:
        copies: some of those that the recorder is to know; each recording once, others in other reports.
        requests: of the hub, the oldest first.
        not_taken, retries: counts over the present run of the bridge.
    """

    instance_id: str
    status: CloudStatus
    copies: tuple[CopyReport, ...] = ()
    requests: tuple[HubRequest, ...] = ()
    not_taken: NotTaken = NotTaken()
    retries: Retries = Retries()


OUTBOX_FULL: Final = 0.9
"""From this part of its limit on, an outbox that has dropped events still counts as full."""


@dataclass(frozen=True, slots=True)
class CloudView:
    """The bridge as its link sees it. Any report makes a new object.

    Attributes:
        error: why it is unreachable; empty while it is reachable.
        since_s: since when it is reachable, or is not.
        report: the newest, kept while it is unreachable; None before the first.
        without_hub_s: since when the hub is not connected, by the reports; None while it is. It counts on
            over a restart of the bridge.
        dropped_s: when the newest dropping of events was reported; None before the first.
    """

    error: str
    since_s: float
    report: Received[BridgeReport] | None = None
    without_hub_s: float | None = None
    dropped_s: float | None = None

    @property
    def reachable(self) -> bool:
        """Whether the bridge answers."""
        return not self.error and self.report is not None

    @property
    def newest(self) -> BridgeReport | None:
        """The newest report of a bridge that answers; None of one that does not."""
        return self.report.value if self.report and not self.error else None

    def status(self, now_s: float) -> CloudStatus:
        """Returns what operators see: while it is unreachable, that, why, and what it was before."""
        if self.report is None or self.error:
            known = self.report.value.status if self.report else CloudStatus(CloudState.UNREACHABLE)
            return CloudStatus(
                CloudState.UNREACHABLE,
                known.robot,
                known.fleet,
                state_age_ms=age_ms(self.since_s, now_s),
                last_error=self.error,
            )
        status, elapsed_ms = self.report.value.status, age_ms(self.report.at_s, now_s)
        sent_ms = status.last_sent_age_ms
        return replace(
            status,
            state_age_ms=status.state_age_ms + elapsed_ms,
            last_sent_age_ms=None if sent_ms is None else sent_ms + elapsed_ms,
        )

    def reported(self, report: BridgeReport, now_s: float) -> "CloudView":
        """Returns the view after a report."""
        status, before = report.status, self.report.value.status if self.report else None
        without_hub_s = self.without_hub_s
        if status.state is CloudState.CONNECTED:
            without_hub_s = None
        elif without_hub_s is None:
            without_hub_s = now_s - status.state_age_ms / 1000
        drops = before is not None and status.events_dropped > before.events_dropped
        return CloudView(
            "",
            now_s if self.error else self.since_s,
            Received(report, now_s),
            without_hub_s,
            now_s if drops else self.dropped_s,
        )

    def lost(self, reason: str, now_s: float) -> "CloudView":
        """Returns the view after a lost connection, or a failed attempt."""
        return replace(self, error=reason, since_s=self.since_s if self.error else now_s)
