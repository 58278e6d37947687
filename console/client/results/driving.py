"""Driving. Velocities are in the robot's frame (REP 103): x forward, y left, turning counter-clockwise."""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple


class DrivePhase(Enum):
    """Phase of driving."""

    UNKNOWN = "unknown"
    """The robot is not set up for driving."""
    DISABLED = "disabled"
    AVAILABLE = "available"
    """No one drives."""
    ARMED = "armed"
    """A driver has the lease and does not hold."""
    DRIVING = "driving"
    STOPPING = "stopping"
    INHIBITED = "inhibited"
    """There are reasons not to move; left when they are gone and the driver has released."""
    STOPPED = "stopped"
    """Until the stop is reset."""


class DriveInhibit(Enum):
    """A reason why the robot does not move."""

    UNKNOWN = "unknown"
    COMMAND_LATE = "command-late"
    """No valid command arrives in time."""
    LOOP_LATE = "loop-late"
    """The driver does not receive the robot's states."""
    PICTURE_MISSING = "picture-missing"
    PICTURE_STALE = "picture-stale"
    ROBOT_STOP = "robot-stop"
    """The robot's own stop is active."""
    BASE_ABSENT = "base-absent"
    """Nothing takes the velocity commands."""
    OUTRANKED = "outranked"
    """The base follows another source."""
    DRIVE_LOST = "drive-lost"
    """The robot's drive program does not answer the gateway."""
    ACCESS_ENDED = "access-ended"


class Supervision(Enum):
    """How the driver sees what the robot does."""

    UNKNOWN = "unknown"
    """As PICTURE."""
    PICTURE = "picture"
    LINE_OF_SIGHT = "line-of-sight"
    """With the own eyes; only where the robot's configuration permits it, and slowly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StopLatch:
    """A stop that stays until it is reset."""

    stop_id: int
    by: str
    """Who or what stopped the robot."""
    reason: str
    """Empty when none was given."""
    age_ms: int


class SpeedLimits(NamedTuple):
    """The largest speeds, each in both directions."""

    vx_mps: float
    vy_mps: float
    wz_rad_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveLimits:
    """What the robot accepts. Faster commands are slowed down, all components by one factor."""

    max_vx_mps: float
    max_vy_mps: float
    """0: the base can't move sideways."""
    max_wz_rad_s: float
    acceleration_mps2: float
    acceleration_rad_s2: float
    max_picture_age_ms: int
    """Age of the driver's picture from which on nothing moves."""
    picture_travel_m: float
    """Farthest motion within one age of the driver's picture."""
    line_of_sight: bool
    """Whether `Supervision.LINE_OF_SIGHT` is permitted."""
    line_of_sight_mps: float
    line_of_sight_rad_s: float

    def permitted(self, supervision: Supervision) -> SpeedLimits:
        """Returns the largest speeds that the robot accepts. What the picture's age permits may be less."""
        if supervision is not Supervision.LINE_OF_SIGHT:
            return SpeedLimits(self.max_vx_mps, self.max_vy_mps, self.max_wz_rad_s)
        return SpeedLimits(
            min(self.max_vx_mps, self.line_of_sight_mps),
            min(self.max_vy_mps, self.line_of_sight_mps),
            min(self.max_wz_rad_s, self.line_of_sight_rad_s),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveOpened:
    """A lane is open."""

    session_id: str
    run_id: str
    limits: DriveLimits
    max_lanes: int
    """Of the session; 0 from a gateway of before there were three."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveState:
    """What the robot does with the driver's commands, at one instant."""

    monotonic_ns: int
    """The robot's monotonic clock."""
    newest_sequence: int
    """Newest command that has arrived there."""
    phase: DrivePhase
    inhibits: tuple[DriveInhibit, ...]
    """Why nothing moves."""
    vx_mps: float
    """Velocity commanded to the base, forward; the others accordingly."""
    vy_mps: float
    wz_rad_s: float
    command_age_ms: int
    loop_age_ms: int
    """From the robot to the driver and back."""
    picture_age_ms: int | None
    speed_limit_mps: float
    """As the supervision permits now."""
    stop: StopLatch | None
    problems: tuple[str, ...]
    """What the drive program says of its base."""
    turn_limit_rad_s: float | None
    """As speed_limit_mps, of the turning rate. None of a robot of an earlier release, and while its drive
    program does not answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotStopped:
    """The robot has confirmed a stop."""

    message: str
    stop: StopLatch


@dataclass(frozen=True, slots=True, kw_only=True)
class StopReset:
    """The robot has confirmed a reset."""

    message: str
    phase: DrivePhase
