"""How a driver steers, whatever with: shares of the permitted velocity. Pure."""

from collections.abc import Collection
from enum import Enum
from typing import Final, NamedTuple


class Steering(NamedTuple):
    """Shares of the permitted velocity, each from -1 to 1, in the robot's frame (REP 103)."""

    forward: float
    left: float
    turn: float
    """Counter-clockwise."""


class Direction(Enum):
    """What a key does while it is down."""

    FORWARD = Steering(1, 0, 0)
    BACK = Steering(-1, 0, 0)
    LEFT = Steering(0, 1, 0)
    RIGHT = Steering(0, -1, 0)
    TURN_LEFT = Steering(0, 0, 1)
    TURN_RIGHT = Steering(0, 0, -1)


LETTERS: Final = {
    "w": Direction.FORWARD,
    "s": Direction.BACK,
    "a": Direction.TURN_LEFT,
    "d": Direction.TURN_RIGHT,
    "q": Direction.LEFT,
    "e": Direction.RIGHT,
}
"""The letters of every keyboard that drives; the arrows do what w, s, a and d do."""


def steering_of(down: Collection[Direction]) -> Steering | None:
    """Returns what the keys that are down amount to; None with no key down.

    Opposite ones cancel out. Two keys of one direction are no more than one.
    """
    if not down:
        return None
    return Steering(*(sum(parts) for parts in zip(*(key.value for key in set(down)), strict=True)))


class Speeds(NamedTuple):
    """What a share of 1 stands for; at the most what `DriveLimits.permitted` returns."""

    vx_mps: float
    vy_mps: float
    wz_rad_s: float

    def velocity(self, steering: Steering) -> tuple[float, float, float]:
        """Returns vx and vy in m/s, and the turning rate in rad/s."""
        return (
            steering.forward * self.vx_mps,
            steering.left * self.vy_mps,
            steering.turn * self.wz_rad_s,
        )
