"""Every configured source as operators see it: what it tells, and whether and why it does not."""

from dataclasses import dataclass
from enum import Enum

from gateway.status.board import SourceKind
from gateway.status.freshness import Freshness


class SourceState(Enum):
    """What is known of a source at one instant."""

    WAITING = "waiting"
    """Nothing has come, and nobody on the robot offers it."""
    SILENT = "silent"
    """Somebody offers it, and nothing has come."""
    RECEIVING = "receiving"
    STALE = "stale"
    """It came once; the newest value is too old."""
    QOS_MISMATCH = "qos_mismatch"
    """It is offered with a quality of service that excludes ours, so nothing can come."""
    WRONG_TYPE = "wrong_type"
    """It is offered as another type than configured, so nothing can come."""
    TYPE_MISSING = "type_missing"
    """Its message type is not installed beside the gateway."""


@dataclass(frozen=True, slots=True)
class SourceView:
    """One configured source at one instant.

    Attributes:
        name: short and stable, for programs: "odometry", "mux_input.keyboard".
        words: the same for people.
        detail: what is known beyond the state, for a person; empty when there is nothing more to say.
    """

    kind: SourceKind
    name: str
    words: str
    state: SourceState
    freshness: Freshness
    required: bool
    detail: str


def state_of(freshness: Freshness, unusable: str | None) -> SourceState:
    """The state that follows."""
    if unusable is not None:
        return SourceState.TYPE_MISSING
    if freshness.available:
        return SourceState.STALE if freshness.stale else SourceState.RECEIVING
    return SourceState.WAITING
