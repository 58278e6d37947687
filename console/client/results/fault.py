"""Faults of the robot, active or recently cleared."""

from dataclasses import dataclass
from enum import Enum


class FaultSeverity(Enum):
    """Severity of a fault or an event."""

    UNKNOWN = "unknown"
    INFO = "info"
    """No function is affected."""
    WARNING = "warning"
    """A function is or will be impaired; the robot can still work."""
    ERROR = "error"
    """The robot can't do a part of its work until this is repaired."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault, detected by the gateway."""

    id: str
    """Stable identifier of the condition: "odometry.stale"."""
    severity: FaultSeverity
    component: str
    """The affected part of the robot."""
    message: str
    """Description of the fault."""
    remedy: str
    """What to check or to do."""
    active: bool
    """Whether it is present now. Cleared faults stay listed for a while."""
    age_ms: int
    """Time since it was raised."""
    cleared_age_ms: int | None
    """Time since it was cleared. None while it is active."""
    times_raised: int
    """How often it was raised since the gateway started, this time included."""
