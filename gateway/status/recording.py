"""Recording: what the recorder reports, and what operators see of it.

Instants ending in `_s` are seconds of the monotonic clock.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final

from gateway.status.values import Received


class RecorderState(Enum):
    """State of the recorder."""

    IDLE = "idle"
    STARTING = "starting"
    RECORDING = "recording"
    FINALISING = "finalising"
    RECOVERING = "recovering"
    FAULTED = "faulted"
    UNREACHABLE = "unreachable"
    """Found by the gateway; the recorder reports all others."""


class RecordingKind(Enum):
    """What made a recording."""

    MANUAL = "manual"
    SNAPSHOT = "snapshot"
    INCIDENT = "incident"
    RUN_BUNDLE = "run bundle"


SNAPSHOTS: Final = frozenset({RecordingKind.SNAPSHOT, RecordingKind.INCIDENT})
"""Made beside the recording that runs."""


class RecordingState(Enum):
    """State of a recording."""

    STARTING = "starting"
    RECORDING = "recording"
    FINALISING = "finalising"
    COMPLETE = "complete"
    RECOVERED = "recovered"
    FAULTED = "faulted"


ENDED: Final = frozenset({RecordingState.COMPLETE, RecordingState.RECOVERED, RecordingState.FAULTED})
"""The states in which nothing is written any more."""


class RecordingStopReason(Enum):
    """Why a recording ended, as the end of a sentence."""

    REQUESTED = "stopped by a caller"
    LIMIT = "it has reached its limit"
    DISK = "the disk has no more room"
    ERROR = "the disk reported an error"
    SHUTDOWN = "the recorder was stopped"
    INTERRUPTED = "the recorder or the robot's computer ended without warning"


class RecordingChange(Enum):
    """What happened to a recording."""

    STARTED = "started"
    ENDED = "ended"
    SNAPSHOT_COMPLETE = "snapshot complete"
    LOSS = "loss"


@dataclass(frozen=True, slots=True)
class RecordingPreset:
    """What can be recorded; see recording.proto."""

    name: str
    description: str
    with_video: bool
    bytes_per_minute: int
    in_ring: bool


@dataclass(frozen=True, slots=True)
class RecorderStatus:
    """The recorder as operators see it; see RecordingStatus in recording.proto.

    Attributes:
        state: as it reports.
        messages_lost: as far as they were counted; None where it is unknown how many.
        uncounted_gaps: gaps of unknown size, which are not in it.
        room_s: None while nothing is written.
    """

    state: RecorderState
    recording_id: str = ""
    label: str = ""
    preset: str = ""
    elapsed_ms: int = 0
    size: int = 0
    messages_written: int = 0
    messages_lost: int | None = None
    uncounted_gaps: int = 0
    video: bool = False
    bytes_per_s: int = 0
    room_bytes: int = 0
    room_s: int | None = None
    ring_s: int = 0
    snapshots_pending: int = 0
    recordings: int = 0
    to_copy: int = 0
    last_error: str = ""
    presets: tuple[RecordingPreset, ...] = ()


@dataclass(frozen=True, slots=True)
class RecordingBrief:
    """What events say of a recording.

    Attributes:
        kind, state, stop_reason: None where the recorder is newer, and for a reason while it has not ended.
    """

    id: str
    label: str
    kind: RecordingKind | None
    state: RecordingState | None
    stop_reason: RecordingStopReason | None
    messages_lost: int | None
    uncounted_gaps: int = 0


@dataclass(frozen=True, slots=True)
class RecorderReport:
    """The state of the recorder at one instant; see recorder_service.proto.

    Attributes:
        ended: the recordings that ended last, the newest first.
    """

    instance_id: str
    status: RecorderStatus
    ended: tuple[RecordingBrief, ...] = ()
    messages_lost: int | None = None
    uncounted_gaps: int = 0
    messages_dropped: int = 0
    ring_failures: int = 0
    disk_free_bytes: int = 0
    disk_size_bytes: int = 0
    disk_short: bool = False

    @property
    def missing(self) -> int:
        """Messages lost or dropped, as far as they were counted."""
        return (self.messages_lost or 0) + self.messages_dropped

    def lacks_more_than(self, before: "RecorderReport") -> bool:
        """Returns whether messages are missing that an earlier report of the same process did not know of."""
        return self.missing > before.missing or self.uncounted_gaps > before.uncounted_gaps


@dataclass(frozen=True, slots=True)
class RecorderView:
    """The recorder as its link sees it. Any report makes a new object.

    Attributes:
        error: why it is unreachable; empty while it is reachable.
        report: the newest, kept while it is unreachable; None before the first.
        lost_s: when the newest loss of messages was reported; None before the first.
    """

    error: str
    report: Received[RecorderReport] | None = None
    lost_s: float | None = None

    @property
    def reachable(self) -> bool:
        """Whether the recorder answers."""
        return not self.error and self.report is not None

    @property
    def status(self) -> RecorderStatus:
        """What operators see: while it is unreachable, that and why."""
        if self.report is None or self.error:
            return RecorderStatus(RecorderState.UNREACHABLE, last_error=self.error)
        return self.report.value.status
