"""Whether the robot can be relied on: the first rule that applies decides."""

from dataclasses import dataclass
from enum import Enum
from typing import Final

from gateway.status.freshness import Freshness


class HealthState(Enum):
    """One word for it."""

    OK = "ok"
    DEGRADED = "degraded"


@dataclass(frozen=True, slots=True)
class Health:
    """One word and one sentence."""

    state: HealthState
    summary: str

    @property
    def ready(self) -> bool:
        """Whether the robot can take work."""
        return self.state is HealthState.OK


HEALTHY: Final = Health(HealthState.OK, "robot healthy")


def assess(odometry: Freshness | None, vision: Freshness | None) -> Health:
    """Applies the rules in the field's order. None: this robot is not required to have the source."""
    if odometry and not odometry.available:
        return _degraded("waiting for odometry")
    if odometry and odometry.stale:
        return _degraded("odometry stale")
    if vision and not vision.available:
        return _degraded("waiting for vision telemetry")
    if vision and vision.stale:
        return _degraded("vision telemetry stale")
    return HEALTHY


def _degraded(summary: str) -> Health:
    return Health(HealthState.DEGRADED, summary)
