"""The robot's health: the first rule that applies decides."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Final

from gateway.status.fault import Fault, Severity
from gateway.status.freshness import Freshness


class HealthState(Enum):
    """Overall verdict."""

    OK = "ok"
    DEGRADED = "degraded"


@dataclass(frozen=True, slots=True)
class RobotHealth:
    """The verdict.

    Attributes:
        summary: its reason in one sentence.
        ready: whether the robot can take work; only the required sources decide that.
    """

    state: HealthState
    summary: str
    ready: bool


HEALTHY: Final = RobotHealth(HealthState.OK, "robot healthy", ready=True)
NOT_READ: Final = RobotHealth(HealthState.DEGRADED, "the gateway does not read ROS", ready=False)


def assess(
    required: Iterable[tuple[str, Freshness]], faults: Iterable[Fault] = (), ignored: Iterable[str] = ()
) -> RobotHealth:
    """Returns the health that follows from the required sources, then from the active errors.

    Args:
        required: name and freshness of each source, the most important first.
        faults: of the robot, the most severe first.
        ignored: fault ids, or their beginnings up to a dot, that degrade nothing.
    """
    for name, freshness in required:
        if not freshness.available:
            return RobotHealth(HealthState.DEGRADED, f"waiting for {name}", ready=False)
        if freshness.stale:
            return RobotHealth(HealthState.DEGRADED, f"{name} stale", ready=False)
    ignored = tuple(f"{each}." for each in ignored)
    errors = [each.condition for each in faults if each.active and each.condition.severity is Severity.ERROR]
    if counted := [each for each in errors if not f"{each.fault_id}.".startswith(ignored)]:
        more = f" (and {len(counted) - 1} more)" if len(counted) > 1 else ""
        return RobotHealth(HealthState.DEGRADED, f"{counted[0].message}{more}", ready=True)
    return HEALTHY
