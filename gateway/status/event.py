"""What can happen that an operator may want to know: one value per kind of event."""

from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from gateway.status.fault import Fault, Severity
from gateway.status.preview import PreviewState, Profile


class ControlResult(Enum):
    """How a control action ended."""

    ACCEPTED = "accepted"
    REFUSED = "refused"
    FAILED = "failed"
    """By a defect of the gateway."""


@dataclass(frozen=True, slots=True)
class FaultRaised:
    """A fault began, or grew worse."""

    fault: Fault


@dataclass(frozen=True, slots=True)
class FaultCleared:
    """A fault is over."""

    fault: Fault


@dataclass(frozen=True, slots=True)
class PreviewChanged:
    """The preview came to rest in another state, or another profile is in force."""

    state: PreviewState
    profile: Profile | None
    last_error: str


@dataclass(frozen=True, slots=True)
class EncoderFallback:
    """Another encoder than the first choice took over."""

    running: str
    wanted: str
    reason: str


@dataclass(frozen=True, slots=True)
class ClientJoined:
    """Somebody watches; `address` says from where."""

    address: str


@dataclass(frozen=True, slots=True)
class ClientLeft:
    """Somebody who was told of watches no more."""

    address: str


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


@dataclass(frozen=True, slots=True)
class ModeChanged:
    """The robot is about something else; empty when it tells no mode any more."""

    mode: str


Detail: TypeAlias = (
    FaultRaised
    | FaultCleared
    | PreviewChanged
    | EncoderFallback
    | ClientJoined
    | ClientLeft
    | ControlAction
    | ModeChanged
)


@dataclass(frozen=True, slots=True)
class News:
    """Something that has just happened.

    Attributes:
        component: the part of the robot that it happened to, as operators call it.
        message: what happened, for a person.
        detail: the same for programs.
        sentence: how the short list of the overlay tells it; None leaves it out there.
    """

    severity: Severity
    component: str
    message: str
    detail: Detail
    sentence: str | None = None


@dataclass(frozen=True, slots=True)
class Event:
    """News in their order.

    Attributes:
        sequence: counts from 1 in this run of the gateway.
        at_s: on the gateway's monotonic clock.
        unix_ms: what the calendar clock showed.
    """

    sequence: int
    at_s: float
    unix_ms: int
    news: News
