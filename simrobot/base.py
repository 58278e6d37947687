"""Double of a mecanum base: what becomes of the velocities that reach it. Pure."""

from dataclasses import dataclass
from typing import Final

TIMEOUT_S: Final = 1.0
"""Silence after which the drive controller stops the wheels."""
WHEEL_MPS: Final = 0.264
"""Largest speed of a wheel's rim. Each wheel is clamped by itself, which bends the direction."""
LEVER_M: Final = 0.2062
"""Half the wheelbase plus half the track."""
_CLOCK_US: Final = 1 << 32


@dataclass(frozen=True, slots=True)
class Twist:
    """Velocity in the body frame of REP 103: x forward, y left, in m/s; turning rate in rad/s."""

    vx_mps: float = 0.0
    vy_mps: float = 0.0
    wz_rad_s: float = 0.0


STILL: Final = Twist()


@dataclass(frozen=True, slots=True)
class Heard:
    """What the base has received of its last motion; instants in monotonic seconds.

    Attributes:
        moved_s: when the last velocity other than zero came.
        zero_s: when the first zero after it came; None while there was none.
    """

    moved_s: float
    zero_s: float | None = None


class Base:
    """Follows the last velocity until its timeout.

    The firmware compares microseconds of 32 bits: 71.6 minutes after the last message that one is young again
    for the length of the timeout. A last message other than zero then moves the robot.

    Attributes:
        heard: of its last motion; None before the first.
    """

    def __init__(self) -> None:
        self._last: tuple[Twist, int] | None = None
        self.heard: Heard | None = None

    def receive(self, wanted: Twist, now_s: float) -> None:
        """Takes a velocity."""
        # One assignment: another thread reads it.
        self._last = clamped(wanted), int(now_s * 1e6)
        if wanted != STILL:
            self.heard = Heard(now_s)
        elif self.heard and self.heard.zero_s is None:
            self.heard = Heard(self.heard.moved_s, now_s)

    def velocity(self, now_s: float) -> Twist:
        """Returns how the robot moves."""
        if self._last is None:
            return STILL
        wanted, at_us = self._last
        age_us = (int(now_s * 1e6) - at_us) % _CLOCK_US
        return wanted if age_us < TIMEOUT_S * 1e6 else STILL


def clamped(wanted: Twist) -> Twist:
    """Returns what four mecanum wheels make of a velocity, each clamped to WHEEL_MPS."""
    turning = LEVER_M * wanted.wz_rad_s
    front_left, front_right, rear_left, rear_right = (
        min(max(wheel, -WHEEL_MPS), WHEEL_MPS)
        for wheel in (
            wanted.vx_mps - wanted.vy_mps - turning,
            wanted.vx_mps + wanted.vy_mps + turning,
            wanted.vx_mps + wanted.vy_mps - turning,
            wanted.vx_mps - wanted.vy_mps + turning,
        )
    )
    return Twist(
        (front_left + front_right + rear_left + rear_right) / 4,
        (-front_left + front_right + rear_left - rear_right) / 4,
        (-front_left + front_right - rear_left + rear_right) / (4 * LEVER_M),
    )
