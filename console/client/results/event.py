"""Events on the robot."""

from dataclasses import dataclass
from enum import Enum

from console.client.results.cloud import CloudEvent, RecordingCopyEvent
from console.client.results.fault import Fault, FaultSeverity
from console.client.results.preview import PreviewProfile, PreviewState
from console.client.results.recording import (
    RecordingChange,
    RecordingKind,
    RecordingState,
    RecordingStopReason,
)


class EventKind(Enum):
    """Kind of an event; the part of the `Event` with the same name has the details."""

    UNKNOWN = "unknown"
    """The gateway is newer than this client; `Event.message` describes the event."""
    FAULT_RAISED = "fault-raised"
    FAULT_CLEARED = "fault-cleared"
    PREVIEW = "preview"
    ENCODER_FALLBACK = "encoder-fallback"
    CLIENT_JOINED = "client-joined"
    CLIENT_LEFT = "client-left"
    CONTROL = "control"
    MODE = "mode"
    RECORDING = "recording"
    CLOUD = "cloud"
    RECORDING_COPY = "recording-copy"


class ControlResult(Enum):
    """Result of a control action."""

    UNKNOWN = "unknown"
    ACCEPTED = "accepted"
    REFUSED = "refused"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class EventPosition:
    """A position in the order of events. `events(after=...)` resumes from it."""

    run_id: str
    """Identifies the run of the gateway program; every start has a new one."""
    sequence: int
    """Number of the newest event before this position; 0 before the first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewEvent:
    """The preview has settled in another state, or changed its profile or its camera."""

    state: PreviewState
    profile: PreviewProfile
    last_error: str
    camera: str = ""
    """The live one. Empty unless the preview runs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderFallback:
    """An encoder other than the robot's first choice took over."""

    running: str
    wanted: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlAction:
    """A client requested a change of the robot."""

    who: str
    """Name of the user; empty where the gateway has no authentication."""
    address: str
    method: str
    request: str
    result: ControlResult
    answer: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingEvent:
    """A recording began or ended, a snapshot is complete, or messages were lost."""

    change: RecordingChange
    recording_id: str
    label: str
    kind: RecordingKind
    """UNKNOWN for a beginning and a loss, which are of recordings started by hand."""
    state: RecordingState
    """UNKNOWN before the end; the next one, too."""
    stop_reason: RecordingStopReason
    messages_lost: int | None
    """So far."""
    uncounted_gaps: int
    """Gaps of unknown size so far."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One event. Of the parts below `kind`, the one that belongs to the kind is set."""

    position: EventPosition
    """The position after this event."""
    monotonic_ns: int
    """Time on the robot's monotonic clock; `Clock.local_s` converts it to this computer's."""
    wall_clock_unix_ms: int
    """Time on the robot's wall clock, in ms since 1970 UTC."""
    severity: FaultSeverity
    component: str
    message: str
    kind: EventKind
    fault: Fault | None = None
    """The fault that was raised or cleared, with its ages at the time of the event."""
    preview: PreviewEvent | None = None
    encoder_fallback: EncoderFallback | None = None
    client_address: str | None = None
    """Address of the client that joined or left."""
    client_name: str | None = None
    """Its user's name; empty where the gateway has no authentication, or is older than this field."""
    control: ControlAction | None = None
    mode: str | None = None
    """The robot's mode, as the robot names it."""
    recording: RecordingEvent | None = None
    cloud: CloudEvent | None = None
    recording_copy: RecordingCopyEvent | None = None

    @property
    def is_presence(self) -> bool:
        """Whether a client has joined or left."""
        return self.kind in (EventKind.CLIENT_JOINED, EventKind.CLIENT_LEFT)


class GapReason(Enum):
    """Why events are missing."""

    UNKNOWN = "unknown"
    NO_LONGER_KEPT = "no-longer-kept"
    """There were more than the gateway keeps."""
    NEW_RUN = "new-run"
    """The gateway was restarted; events that the earlier run had not sent are lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EventGap:
    """Events are missing here; those that follow are complete again."""

    reason: GapReason
    missed_count: int
    """Of the present run; those of an earlier run can't be counted."""
    position: EventPosition
    """The position after the gap."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaughtUp:
    """All events up to this position have been delivered."""

    position: EventPosition
