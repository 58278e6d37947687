"""From a driver's velocity to the one that is published: limits, age of the picture, acceleration. Pure."""

from dataclasses import dataclass
from math import copysign, inf

from drive.values import ZERO, Supervision, Velocity


@dataclass(frozen=True, slots=True)
class Limits:
    """What the robot may do.

    Attributes:
        vx_mps, vy_mps, wz_rad_s: largest magnitude of each component; 0 where the base can't move that way.
        wheel_mps: largest speed of a wheel's rim, where the base clamps each wheel and so bends the
            direction; 0 without such a limit. A mecanum wheel runs at |vx| + |vy| + wheel_lever_m * |wz|.
        wheel_lever_m: half the wheelbase plus half the track of a mecanum base.
        acceleration_mps2, acceleration_rad_s2: how fast speed may grow. Slowing down has no limit.
        picture_travel_m, picture_turn_rad: farthest motion within one age of the driver's picture.
        line_of_sight_mps, line_of_sight_rad_s: largest speed without a picture.
    """

    vx_mps: float = 0.35
    vy_mps: float = 0.35
    wz_rad_s: float = 0.8
    wheel_mps: float = 0.264
    wheel_lever_m: float = 0.206
    acceleration_mps2: float = 0.7
    acceleration_rad_s2: float = 1.6
    picture_travel_m: float = 0.10
    picture_turn_rad: float = 0.35
    line_of_sight_mps: float = 0.15
    line_of_sight_rad_s: float = 0.4


def limited(wanted: Velocity, limits: Limits) -> Velocity:
    """Returns the velocity nearest to `wanted` in the same direction that all limits allow.

    All components are scaled by one factor, so that the robot goes where it is steered, only slower. A motion
    that the base can't make is left out.
    """
    if not limits.vy_mps:
        wanted = Velocity(wanted.vx_mps, 0.0, wanted.wz_rad_s)
    rim_mps = abs(wanted.vx_mps) + abs(wanted.vy_mps) + limits.wheel_lever_m * abs(wanted.wz_rad_s)
    factor = min(
        _factor(wanted.vx_mps, limits.vx_mps),
        _factor(wanted.vy_mps, limits.vy_mps),
        _factor(wanted.wz_rad_s, limits.wz_rad_s),
        _factor(rim_mps, limits.wheel_mps) if limits.wheel_mps else 1.0,
    )
    return wanted.scaled(factor)


def supervised(wanted: Velocity, supervision: Supervision, picture_age_s: float, limits: Limits) -> Velocity:
    """Returns `wanted`, slowed down to what the driver can supervise."""
    linear_mps = supervised_limit_mps(supervision, picture_age_s, limits)
    if supervision is Supervision.LINE_OF_SIGHT:
        angular_rad_s = limits.line_of_sight_rad_s
    else:
        angular_rad_s = _within_one_age(limits.picture_turn_rad, picture_age_s)
    return wanted.scaled(min(_factor(wanted.linear_mps, linear_mps), _factor(wanted.wz_rad_s, angular_rad_s)))


def supervised_limit_mps(supervision: Supervision, picture_age_s: float, limits: Limits) -> float:
    """Returns the largest speed that the driver can supervise; infinite for a picture of this instant."""
    if supervision is Supervision.LINE_OF_SIGHT:
        return limits.line_of_sight_mps
    return _within_one_age(limits.picture_travel_m, picture_age_s)


def approached(current: Velocity, target: Velocity, elapsed_s: float, limits: Limits) -> Velocity:
    """Returns the velocity on the way from `current` to `target` after `elapsed_s`.

    Each component slows down at once and speeds up at the limit; through a reversal it passes zero. It never
    overshoots its target.
    """
    linear, angular = limits.acceleration_mps2 * elapsed_s, limits.acceleration_rad_s2 * elapsed_s
    return Velocity(
        _component(current.vx_mps, target.vx_mps, linear),
        _component(current.vy_mps, target.vy_mps, linear),
        _component(current.wz_rad_s, target.wz_rad_s, angular),
    )


def ramped_down(start: Velocity, elapsed_s: float, ramp_s: float) -> Velocity:
    """Returns the velocity `elapsed_s` after a release at `start`; zero from `ramp_s` on."""
    return ZERO if elapsed_s >= ramp_s else start.scaled(1 - elapsed_s / ramp_s)


def _within_one_age(distance: float, picture_age_s: float) -> float:
    return distance / picture_age_s if picture_age_s > 0 else inf


def _factor(value: float, limit: float) -> float:
    magnitude = abs(value)
    return 1.0 if magnitude <= limit else limit / magnitude


def _component(current: float, target: float, step: float) -> float:
    if current * target < 0:
        current = 0.0
    if abs(target) <= abs(current):
        return target
    return copysign(min(abs(target), abs(current) + step), target)
