"""What happens on the robot, as it happens."""

from dataclasses import dataclass
from enum import Enum

from console.client.results.fault import Fault, FaultSeverity
from console.client.results.preview import PreviewProfile, PreviewState


class EventKind(Enum):
    """What kind of thing happened; the part of the `Event` with the same name tells more."""

    UNKNOWN = "unknown"
    """The gateway is newer than this client; `Event.message` says what it is."""
    FAULT_RAISED = "fault-raised"
    FAULT_CLEARED = "fault-cleared"
    PREVIEW = "preview"
    ENCODER_FALLBACK = "encoder-fallback"
    CLIENT_JOINED = "client-joined"
    CLIENT_LEFT = "client-left"
    CONTROL = "control"
    MODE = "mode"


class ControlResult(Enum):
    """What became of a control action."""

    UNKNOWN = "unknown"
    ACCEPTED = "accepted"
    REFUSED = "refused"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class EventPosition:
    """A place in the order of events. Keep it, and `events(after=...)` goes on from there."""

    run_id: str
    """Which run of the gateway program: another one after each start of it."""
    sequence: int
    """The newest event before this place; 0 before the first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewEvent:
    """The preview came to rest in another state, or another profile is in force."""

    state: PreviewState
    profile: PreviewProfile
    last_error: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderFallback:
    """Another encoder than the robot's first choice took over."""

    running: str
    wanted: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlAction:
    """Somebody asked for something that changes the robot."""

    who: str
    """Empty where the gateway doesn't ask who calls."""
    address: str
    method: str
    request: str
    result: ControlResult
    answer: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something happened. Of the parts below `kind`, the one that belongs to the kind is set."""

    position: EventPosition
    """The place after this event."""
    monotonic_ns: int
    """When, on the robot's monotonic clock; `Clock.local_s` makes it an instant of this computer."""
    wall_clock_unix_ms: int
    """What the robot's calendar clock showed."""
    severity: FaultSeverity
    component: str
    message: str
    kind: EventKind
    fault: Fault | None = None
    """Of a fault raised or cleared; its ages are those at the time of the event."""
    preview: PreviewEvent | None = None
    encoder_fallback: EncoderFallback | None = None
    client_address: str | None = None
    """Of a client that joined or left."""
    control: ControlAction | None = None
    mode: str | None = None
    """The robot's mode, in its own words."""


class GapReason(Enum):
    """Why events are missing."""

    UNKNOWN = "unknown"
    NO_LONGER_KEPT = "no-longer-kept"
    """More came than the gateway keeps."""
    NEW_RUN = "new-run"
    """The gateway was started anew; what the earlier run had not sent is lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EventGap:
    """Here events are missing; what follows is whole again."""

    reason: GapReason
    missed_count: int
    """Of the present run. How many of an earlier run are missing nobody knows."""
    position: EventPosition
    """The place after the gap."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaughtUp:
    """Everything that has happened up to here was told."""

    position: EventPosition
