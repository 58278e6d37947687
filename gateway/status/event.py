"""Events: what happened on the robot that an operator may want to know, one detail type per kind."""

import math
import time
from dataclasses import dataclass, field
from enum import Enum
from typing import TypeAlias

from gateway.status.cloud import CloudState, RecordingCopy
from gateway.status.fault import Fault, Severity
from gateway.status.preview import PreviewState, Profile
from gateway.status.recording import (
    RecordingChange,
    RecordingKind,
    RecordingState,
    RecordingStopReason,
)


class ControlResult(Enum):
    """How a control action ended."""

    ACCEPTED = "accepted"
    REFUSED = "refused"
    FAILED = "failed"
    """By a defect of the gateway."""


@dataclass(frozen=True, slots=True)
class FaultRaised:
    """A fault began or became more severe."""

    fault: Fault


@dataclass(frozen=True, slots=True)
class FaultCleared:
    """A fault ended."""

    fault: Fault


@dataclass(frozen=True, slots=True)
class PreviewChanged:
    """The preview settled in another state, with another profile, or shows another camera.

    Attributes:
        camera: the live one; empty unless it runs.
    """

    state: PreviewState
    profile: Profile | None
    last_error: str
    camera: str = ""


@dataclass(frozen=True, slots=True)
class EncoderFallback:
    """Another encoder than the preferred one took over."""

    running: str
    wanted: str
    reason: str


@dataclass(frozen=True, slots=True)
class ClientJoined:
    """A client has had a stream open for a while; `who` is empty where callers are not authenticated."""

    address: str
    who: str = ""


@dataclass(frozen=True, slots=True)
class ClientLeft:
    """A client that had joined closed its last stream; `who` as in `ClientJoined`."""

    address: str
    who: str = ""


@dataclass(frozen=True, slots=True)
class Motion:
    """How long and how far the robot was driven, and with what; one time of motion, or the sum of several."""

    duration_s: float
    distance_m: float
    turned_rad: float
    device: str

    def __str__(self) -> str:
        """Returns the text for people."""
        by = f", by {self.device}" if self.device else ""
        turned_deg = math.degrees(self.turned_rad)
        return f"{self.duration_s:.1f} s, {self.distance_m:.2f} m, {turned_deg:.0f} deg{by}"

    def and_then(self, newer: "Motion") -> "Motion":
        """Returns both as one."""
        device = newer.device if newer.device == self.device else f"{newer.device} and others"
        return Motion(
            self.duration_s + newer.duration_s,
            self.distance_m + newer.distance_m,
            self.turned_rad + newer.turned_rad,
            device,
        )


@dataclass(frozen=True, slots=True)
class ControlAction:
    """A call that changes the robot, or tried to; also what the audit log records.

    Attributes:
        who: the caller's name; empty where callers are not authenticated.
        address: where the call came from.
        method: of the contract.
        request: its parameters as text.
        answer: what the caller was answered, as text.
        role: the caller's; empty like `who`.
        credential: ID of the one that was shown; empty like `who`.
        request_id: as in the logs.
        unix_s: when it ended; calendar clock, seconds since 1970.
        count: how many actions this one stands for; the newest of them is described.
        earlier_unix_s: when the first of the others ended, oldest first; not more than a few.
        motion: of a time of motion, all of those that it stands for; `request` says the same.
        motions: where it stands for several times of motion, each of those that ended at `earlier_unix_s`,
            and the newest.
    """

    who: str
    address: str
    method: str
    request: str
    result: ControlResult
    answer: str
    role: str = ""
    credential: str = ""
    request_id: str = ""
    unix_s: float = field(default_factory=time.time, compare=False)
    count: int = 1
    earlier_unix_s: tuple[float, ...] = field(default=(), compare=False)
    motion: Motion | None = field(default=None, compare=False)
    motions: tuple[Motion, ...] = field(default=(), compare=False)


@dataclass(frozen=True, slots=True)
class ModeChanged:
    """The robot reports another mode; empty when it no longer reports one."""

    mode: str


@dataclass(frozen=True, slots=True)
class RecordingChanged:
    """A recording began or ended, a snapshot is complete, or messages were lost.

    Attributes:
        kind, state, stop_reason: None where they are not known, and before the end.
        messages_lost: so far, as far as they were counted; None if unknown.
        uncounted_gaps: gaps of unknown size so far.
    """

    change: RecordingChange
    recording_id: str
    label: str
    kind: RecordingKind | None = None
    state: RecordingState | None = None
    stop_reason: RecordingStopReason | None = None
    messages_lost: int | None = None
    uncounted_gaps: int = 0


@dataclass(frozen=True, slots=True)
class CloudChanged:
    """The connection to the fleet's hub settled in another state."""

    state: CloudState
    last_error: str


@dataclass(frozen=True, slots=True)
class RecordingCopyChanged:
    """A recording has been copied to the fleet's store, or that has failed; `label` is empty if unknown."""

    recording_id: str
    label: str
    copy: RecordingCopy


Detail: TypeAlias = (
    FaultRaised
    | FaultCleared
    | PreviewChanged
    | EncoderFallback
    | ClientJoined
    | ClientLeft
    | ControlAction
    | ModeChanged
    | RecordingChanged
    | CloudChanged
    | RecordingCopyChanged
)


@dataclass(frozen=True, slots=True)
class Event:
    """Something that has just happened.

    Attributes:
        component: the affected part of the robot, by the operators' name for it.
        message: for people.
        detail: for programs.
        sentence: its text in the overlay's short list; None leaves it out there.
    """

    severity: Severity
    component: str
    message: str
    detail: Detail
    sentence: str | None = None


@dataclass(frozen=True, slots=True)
class LoggedEvent:
    """Numbered, timestamped event.

    Attributes:
        sequence: counts from 1 in this run of the gateway.
        at_s: seconds, on the gateway's monotonic clock.
        unix_ms: calendar clock, ms since 1970 (UTC).
    """

    sequence: int
    at_s: float
    unix_ms: int
    event: Event
