"""From a driver's velocity to the one that is published: limits, age of the picture, acceleration. Pure."""

from dataclasses import dataclass
from math import copysign, hypot, inf

from drive.motion.values import ZERO, Supervision, Velocity


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
    angular_rad_s = supervised_limit_rad_s(supervision, picture_age_s, limits)
    return wanted.scaled(min(_factor(wanted.linear_mps, linear_mps), _factor(wanted.wz_rad_s, angular_rad_s)))


def supervised_limit_mps(supervision: Supervision, picture_age_s: float, limits: Limits) -> float:
    """Returns the largest speed that the driver can supervise; infinite for a picture of this instant."""
    if supervision is Supervision.LINE_OF_SIGHT:
        return limits.line_of_sight_mps
    return _within_one_age(limits.picture_travel_m, picture_age_s)


def supervised_limit_rad_s(supervision: Supervision, picture_age_s: float, limits: Limits) -> float:
    """Returns the largest turning rate that the driver can supervise; infinite as the speed."""
    if supervision is Supervision.LINE_OF_SIGHT:
        return limits.line_of_sight_rad_s
    return _within_one_age(limits.picture_turn_rad, picture_age_s)


def approached(current: Velocity, target: Velocity, elapsed_s: float, limits: Limits) -> Velocity:
    """Returns the velocity on the way from `current` to `target` after `elapsed_s`.

    Each component slows down at once; through a reversal it passes zero. What speeds up does so by one
    factor: each at a limit of its own, the shorter ones would arrive first and bend the way there. It never
    overshoots its target.
    """
    start = Velocity(
        _slowed(current.vx_mps, target.vx_mps),
        _slowed(current.vy_mps, target.vy_mps),
        _slowed(current.wz_rad_s, target.wz_rad_s),
    )
    linear_mps = hypot(target.vx_mps - start.vx_mps, target.vy_mps - start.vy_mps)
    factor = min(
        _factor(linear_mps, limits.acceleration_mps2 * elapsed_s),
        _factor(target.wz_rad_s - start.wz_rad_s, limits.acceleration_rad_s2 * elapsed_s),
    )
    if factor == 1.0:
        return target
    return Velocity(
        _grown(start.vx_mps, target.vx_mps, factor),
        _grown(start.vy_mps, target.vy_mps, factor),
        _grown(start.wz_rad_s, target.wz_rad_s, factor),
    )


def ramped_down(start: Velocity, elapsed_s: float, ramp_s: float) -> Velocity:
    """Returns the velocity `elapsed_s` after a release at `start`; zero from `ramp_s` on."""
    return ZERO if elapsed_s >= ramp_s else start.scaled(1 - elapsed_s / ramp_s)


def _within_one_age(distance: float, picture_age_s: float) -> float:
    return distance / picture_age_s if picture_age_s > 0 else inf


def _factor(value: float, limit: float) -> float:
    magnitude = abs(value)
    return 1.0 if magnitude <= limit else limit / magnitude


def _slowed(current: float, target: float) -> float:
    """Returns what a component has at once."""
    if current * target < 0:
        return 0.0
    return target if abs(target) <= abs(current) else current


def _grown(start: float, target: float, factor: float) -> float:
    """Returns a component by this factor on its way; rounding takes it no farther than its target."""
    return copysign(min(abs(target), abs(start + factor * (target - start))), target)
