"""What the hub has about robots. Texts are printable; sizes are in bytes, `unix_ms` is ms since 1970 UTC."""

from dataclasses import dataclass, field
from enum import Enum
from typing import TypeAlias

from console.client.results import (
    DrivePhase,
    Event,
    FaultSeverity,
    HealthState,
    NumberValue,
    Orientation,
    Position,
    PreviewState,
    RecorderState,
    Recording,
    RecordingCopy,
    RecordingFile,
    TextValue,
)
from fleet.standing import Standing


class DropReason(Enum):
    """Why events are missing."""

    UNKNOWN = "unknown"
    OUTBOX_FULL = "outbox-full"
    """The robot's outbox was full while the hub could not be reached."""
    NO_LONGER_KEPT = "no-longer-kept"
    """The gateway no longer kept them when the bridge asked."""
    DISK = "disk"
    """The bridge could not write them to its disk."""
    OUTBOX_LOST = "outbox-lost"
    """The outbox was damaged, or was deleted."""


class CommandOutcome(Enum):
    """What became of a command."""

    UNKNOWN = "unknown"
    DONE = "done"
    """It was carried out, or has begun to be."""
    REFUSED = "refused"
    """The robot's configuration does not allow it, or it is invalid."""
    EXPIRED = "expired"
    FAILED = "failed"
    """It was allowed and has failed."""


class ReceiptCheck(Enum):
    """Whether a receiver has confirmed a recording."""

    VALID = "verified"
    """Its signature is that of one of the fleet's receivers, and it is of this recording."""
    MISSING = "no receipt"
    UNKNOWN_KEY = "unknown key"
    """It is signed by a key that this login does not have."""
    INVALID = "invalid"
    """The signature does not belong to it, or it is of something else."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultBrief:
    """An active fault."""

    fault_id: str
    severity: FaultSeverity
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadBrief:
    """An upload that runs or waits."""

    recording_id: str
    label: str
    copy: RecordingCopy
    size: int
    bytes_per_s: int
    """At present; 0 unless it is being uploaded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotState:
    """A robot at a glance, as it last reported."""

    bridge_run_id: str
    sequence: int
    wall_clock_unix_ms: int
    """By the robot's own clock."""
    bridge_version: str
    gateway_reachable: bool
    """If not, what follows is the robot's last known state."""
    gateway_name: str
    gateway_version: str
    gateway_run_id: str
    gateway_uptime_s: int
    ready: bool
    health: HealthState
    summary: str
    mode: str
    faults: tuple[FaultBrief, ...]
    """The worst and then the oldest first, at most 8."""
    fault_count: int
    """In all."""
    battery_percent: int | None
    charging: bool | None
    disk_used_percent: int | None
    preview: PreviewState
    drive: DrivePhase
    recorder: RecorderState
    recordings_to_copy: int
    uploads: tuple[UploadBrief, ...]
    """In their order, at most 4."""
    upload_count: int
    """In all."""
    outbox_events: int
    events_dropped: int
    gateway_target: str
    """Where an operator near the robot reaches its gateway; empty if not configured."""
    numbers: tuple[NumberValue, ...]
    """Of its configuration, in that order, at most 16. Ages are as of the state, limits are unknown."""
    texts: tuple[TextValue, ...]
    """The same."""
    values_left_out: int
    """Numbers and texts that the robot has besides."""
    position: Position
    orientation: Orientation


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetRow:
    """One robot of the fleet at one instant."""

    robot: str
    standing: Standing
    since_ms: int | None
    """How long that has lasted; "up" since the gateway's start, "away" since the last state."""
    last_seen_ms: int | None
    """Age of the newest state by the hub's clock; None if it has never been seen."""
    problem: str
    """Why what it sends is unreadable; empty otherwise."""
    state: RobotState | None
    """None if it was never seen, or is unreadable."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EventsDropped:
    """Events are missing here: those of the run with the sequences first to last."""

    reason: DropReason
    first_sequence: int
    last_sequence: int
    worst_severity: FaultSeverity
    """The highest among them; UNKNOWN if that is not known."""
    earlier_run_incomplete: bool
    """Whether the last events of an earlier run are missing before these, in unknown number."""
    robot: str
    run_id: str

    @property
    def count(self) -> int:
        """How many are missing."""
        return self.last_sequence - self.first_sequence + 1


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotEvent:
    """An event of a robot."""

    robot: str
    received_unix_ms: int
    """When the hub took it, by the hub's clock."""
    event: Event


@dataclass(frozen=True, slots=True, kw_only=True)
class Unreadable:
    """Something in the hub that is not what its place requires."""

    robot: str
    problem: str


FleetItem: TypeAlias = RobotEvent | EventsDropped | Unreadable
"""What `robotctl fleet events` shows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRecording:
    """A recording in the hub's store."""

    robot: str
    recording: Recording
    files: tuple[RecordingFile, ...]
    receipt: ReceiptCheck
    verified_unix_ms: int | None
    """By the receiver's clock; None without a valid receipt."""
    location: str
    """Where it is, as "s3://bucket/prefix"; empty without a valid receipt."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandAnswer:
    """A robot's answer to a command."""

    command_id: str
    robot: str
    outcome: CommandOutcome
    message: str
    recording_id: str
    """That a snapshot has become, or that is uploaded; otherwise empty."""


@dataclass(frozen=True, slots=True)
class Enrolment:
    """An entry of the hub's list of robots.

    Args:
        robot: Its name.
        revoked: Whether its credential is revoked.
        since_unix_ms: When it was enrolled or revoked, by the hub's clock; None if that is not known.
    """

    robot: str
    revoked: bool = False
    since_unix_ms: int | None = field(default=None)
