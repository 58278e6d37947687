"""The robot's motion, as the gauges show it. Pure."""

from dataclasses import dataclass
from typing import Final

from console.client.results import Freshness
from console.monitor.monitor_state import MonitorState

_TOPS: Final = (0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0)
"""Upper ends of a scale, for robots that name no limit."""
_MARGIN: Final = 1.25


@dataclass(frozen=True, slots=True)
class Reading:
    """One gauge.

    Args:
        value: signed where it has a direction.
        top: upper end of the scale; with a direction the lower end is its opposite.
    """

    value: float
    top: float


@dataclass(frozen=True, slots=True)
class Motion:
    """Speed and turn rate.

    Args:
        speed: over ground, m/s.
        turn: counter-clockwise, rad/s.
        stale: whether this was measured too long ago.
    """

    speed: Reading
    turn: Reading
    stale: bool


def motion(state: MonitorState, now_s: float, before: Motion | None = None) -> Motion | None:
    """Returns the robot's motion; None on a robot without odometry.

    Args:
        state: the latest.
        now_s: on the monotonic clock.
        before: the previous one: a scale never shrinks, so that the gauges do not jump.
    """
    if state.snapshot is None or not state.snapshot.status.odometry.available:
        return None
    status = state.snapshot.status
    odometry, limits = status.odometry, status.teleop
    speed, turn = odometry.linear_speed_mps or 0.0, odometry.wz_rad_s or 0.0
    return Motion(
        Reading(speed, _top(speed, limits.max_linear_mps, before.speed.top if before else 0.0)),
        Reading(turn, _top(abs(turn), limits.max_angular_rad_s, before.turn.top if before else 0.0)),
        odometry.freshness is not Freshness.FRESH or state.outdated(now_s),
    )


def _top(value: float, limit: float, before: float) -> float:
    least = max(before, limit)
    if value <= least and least > 0:
        return least
    return next((top for top in _TOPS if top >= value * _MARGIN), value)
