"""Faults: conditions of the robot that an operator should act on, with their severity and duration."""

from dataclasses import dataclass
from enum import Enum


class Severity(Enum):
    """Severity of a fault or event, in ascending order."""

    INFO = "info"
    """For information; nothing is impaired."""
    WARNING = "warning"
    """Something is impaired or will be; the robot can still take work."""
    ERROR = "error"
    """A part of the robot's work is impossible until this is repaired."""

    @property
    def rank(self) -> int:
        """Larger is worse."""
        return _RANKS[self]


_RANKS = {severity: rank for rank, severity in enumerate(Severity)}


@dataclass(frozen=True, slots=True)
class Condition:
    """An abnormal condition at one instant.

    Attributes:
        fault_id: the same whenever the condition recurs; "odometry.stale" for example.
        component: the affected part of the robot under the name that operators use.
        message: the problem in a sentence. Holds no measured values: they change all the time.
        remedy: what to check or to do.
    """

    fault_id: str
    severity: Severity
    component: str
    message: str
    remedy: str


@dataclass(frozen=True, slots=True)
class Fault:
    """A condition over time; instants are on the gateway's monotonic clock.

    Attributes:
        condition: as observed last.
        onset_s: when it was observed first.
        seen_s: when it was observed last.
        cleared_s: when it was cleared; None while it is active.
        times_raised: how often it was raised since the gateway started, this time included.
        seen_severity: of the condition at the newest look; None where that was absent, so that the fault is
            about to be cleared. A rule repeats this, and not the fault, while it does not know better.
    """

    condition: Condition
    onset_s: float
    seen_s: float
    cleared_s: float | None
    times_raised: int
    seen_severity: Severity | None = None

    @property
    def active(self) -> bool:
        """Whether it has not been cleared."""
        return self.cleared_s is None
