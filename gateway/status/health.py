"""The robot's health: the first rule that applies decides."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Final

from gateway.status.freshness import Freshness


class HealthState(Enum):
    """Overall verdict."""

    OK = "ok"
    DEGRADED = "degraded"


@dataclass(frozen=True, slots=True)
class Health:
    """The verdict and its reason in one sentence."""

    state: HealthState
    summary: str

    @property
    def ready(self) -> bool:
        """Whether the robot can take work."""
        return self.state is HealthState.OK


HEALTHY: Final = Health(HealthState.OK, "robot healthy")
NOT_READ: Final = Health(HealthState.DEGRADED, "the gateway does not read ROS")


def assess(required: Iterable[tuple[str, Freshness]]) -> Health:
    """Returns the health that follows from the required sources.

    Args:
        required: name and freshness of each, the most important first.
    """
    for name, freshness in required:
        if not freshness.available:
            return Health(HealthState.DEGRADED, f"waiting for {name}")
        if freshness.stale:
            return Health(HealthState.DEGRADED, f"{name} stale")
    return HEALTHY
