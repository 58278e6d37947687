"""Where a robot of the fleet stands, by its enrolment and its newest state. Pure."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Final

AWAY_AFTER_S: Final = 30.0
"""Age of the newest state from which on a robot counts as away: three times the pause between two states."""


class Standing(Enum):
    """Where a robot stands."""

    UP = "up"
    """Bridge and gateway are running."""
    NO_GATEWAY = "no gateway"
    """The bridge is connected, and does not reach the robot's gateway."""
    AWAY = "away"
    """It was connected, and is not any more."""
    NEVER_SEEN = "never seen"
    """Enrolled, and never connected."""
    REVOKED = "revoked"
    """Its credential is revoked."""
    NOT_ENROLLED = "not enrolled"
    """The hub has a state of a robot that is not on its list."""
    UNREADABLE = "unreadable"
    """What it sends is not a state."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the hub has about a robot.

    Args:
        enrolled: Whether it is on the hub's list.
        revoked: Whether its credential is revoked.
        age_s: Age of its newest state by the hub's clock; None without one.
        readable: Whether that is a state of this robot.
        gateway_reachable: What the state says of its gateway.
    """

    enrolled: bool
    revoked: bool = False
    age_s: float | None = None
    readable: bool = True
    gateway_reachable: bool = False


_RULES: Final[tuple[tuple[Standing, Callable[[Evidence], bool]], ...]] = (
    (Standing.REVOKED, lambda it: it.revoked),
    (Standing.NOT_ENROLLED, lambda it: not it.enrolled),
    (Standing.NEVER_SEEN, lambda it: it.age_s is None),
    (Standing.UNREADABLE, lambda it: not it.readable),
    (Standing.AWAY, lambda it: it.age_s is not None and it.age_s > AWAY_AFTER_S),
    (Standing.NO_GATEWAY, lambda it: not it.gateway_reachable),
    (Standing.UP, lambda _: True),
)
"""The first that applies decides."""


def standing(evidence: Evidence) -> Standing:
    """Returns where a robot stands."""
    return next(found for found, applies in _RULES if applies(evidence))
