"""What is wrong with the robot, or was a moment ago."""

from dataclasses import dataclass
from enum import Enum


class FaultSeverity(Enum):
    """How much a fault matters."""

    UNKNOWN = "unknown"
    INFO = "info"
    """Worth knowing; nothing is lost."""
    WARNING = "warning"
    """Something is lost or will be; the robot can still take work."""
    ERROR = "error"
    """The robot can't do a part of its work until this is mended."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault, found by the gateway itself."""

    id: str
    """The same for the same trouble whenever it comes: "odometry.stale"."""
    severity: FaultSeverity
    component: str
    """The part of the robot that has it."""
    message: str
    """What is wrong."""
    remedy: str
    """What to look at or to do."""
    active: bool
    """Whether it is there now. Faults that are over stay listed for a while."""
    age_ms: int
    """How long ago it began."""
    cleared_age_ms: int | None
    """How long ago it was over. None while it is active."""
    times_raised: int
    """How often it came since the gateway started, this time included."""
