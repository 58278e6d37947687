"""One fault: what is wrong, how bad it is, since when, until when."""

from dataclasses import dataclass
from enum import Enum


class Severity(Enum):
    """How much a fault matters. The order of the members is the order of importance."""

    INFO = "info"
    """Worth knowing; nothing is lost."""
    WARNING = "warning"
    """Something is lost or will be; the robot can still take work."""
    ERROR = "error"
    """The robot can't do a part of its work until this is mended."""

    @property
    def rank(self) -> int:
        """Larger is worse."""
        return _RANKS[self]


_RANKS = {severity: rank for rank, severity in enumerate(Severity)}


@dataclass(frozen=True, slots=True)
class Condition:
    """Something that is wrong at one instant.

    Attributes:
        fault_id: the same for the same trouble whenever it comes, "odometry.stale" for example.
        component: the part of the robot that has it, as operators call it.
        message: what is wrong. Free of figures that change all the time: the values have their own place.
        remedy: what to look at or to do.
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
        condition: as it was seen last.
        onset_s: when it was seen first.
        seen_s: when it was seen last.
        cleared_s: when it was over; None while the fault is active.
        times_raised: how often this fault came since the gateway started, this time included.
    """

    condition: Condition
    onset_s: float
    seen_s: float
    cleared_s: float | None
    times_raised: int

    @property
    def active(self) -> bool:
        """Whether it is still there."""
        return self.cleared_s is None
