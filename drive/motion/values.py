"""Values of driving: velocities, commands, leases, the stop latch.

Velocities are in the body frame of REP 103: x forward, y left, z up; m/s and rad/s. Instants are nanoseconds
of CLOCK_MONOTONIC, which the gateway and the drive program share.
"""

from dataclasses import dataclass
from enum import Enum
from math import hypot, isfinite
from typing import Final

MS: Final = 1_000_000
"""Nanoseconds in a millisecond."""
DISCOVERY_NS: Final = 3_000 * MS
"""Until a program that joins the graph has discovered the others, if there are any."""


@dataclass(frozen=True, slots=True)
class Velocity:
    """Velocity over ground, as in geometry_msgs/Twist: linear x and y, angular z."""

    vx_mps: float = 0.0
    vy_mps: float = 0.0
    wz_rad_s: float = 0.0

    @property
    def is_finite(self) -> bool:
        """Whether no component is NaN or infinite."""
        return isfinite(self.vx_mps) and isfinite(self.vy_mps) and isfinite(self.wz_rad_s)

    @property
    def linear_mps(self) -> float:
        """Speed over ground, never negative."""
        return hypot(self.vx_mps, self.vy_mps)

    def scaled(self, factor: float) -> "Velocity":
        """Returns the same motion, slower: direction and curvature stay."""
        return Velocity(self.vx_mps * factor, self.vy_mps * factor, self.wz_rad_s * factor)


ZERO: Final = Velocity()


class Supervision(Enum):
    """How the driver sees what the robot does."""

    PICTURE = "picture"
    """By the preview: motion only while the driver's picture is fresh."""
    LINE_OF_SIGHT = "line of sight"
    """With the own eyes, or through an older tool that does not report its picture."""


class Inhibit(Enum):
    """A reason why the robot must not move."""

    COMMAND_LATE = "no valid command of the driver"
    LOOP_LATE = "the driver does not receive the robot's answers"
    PICTURE_MISSING = "the driver has no picture"
    PICTURE_STALE = "the driver's picture is too old"
    ROBOT_STOP = "the robot's own stop is active"
    BASE_ABSENT = "nothing takes the velocity commands"
    OUTRANKED = "another source of commands has priority"


class LeaseEnd(Enum):
    """Why a lease ended."""

    CLOSED = "closed"
    """By its driver."""
    LOST = "lost"
    """The driver's connections ended, or were silent for too long."""
    TAKEN_OVER = "taken over"
    """By another driver."""
    ACCESS_ENDED = "access ended"
    """The driver's credential was revoked or has expired."""


@dataclass(frozen=True, slots=True)
class Lease:
    """The right of one session to drive, which the gateway grants.

    Attributes:
        session_id: names the session; never used again.
        holder: who drives, for people.
        supervision: what `Command.picture_ns` is judged by.
        streaming: commands come all the time, pressed or not, as TeleopService.Drive sends them. Without it
            the end of a command's validity is its release: SendTeleopCommand knows no other.
    """

    session_id: str
    holder: str
    supervision: Supervision = Supervision.PICTURE
    streaming: bool = True


@dataclass(frozen=True, slots=True)
class Command:
    """A driver's command.

    Attributes:
        sequence: grows with each command of a session; a command on several lanes has one sequence.
        held: whether the driver holds the control that makes the robot run.
        valid_until_ns: no motion by it afterwards.
        echo_ns: the newest instant of the robot's clock that the driver has received.
        picture_ns: when the picture that the driver saw was captured; 0 without one.
    """

    session_id: str
    sequence: int
    held: bool
    velocity: Velocity = ZERO
    valid_until_ns: int = 0
    echo_ns: int = 0
    picture_ns: int = 0


@dataclass(frozen=True, slots=True)
class Latch:
    """A stop that stays until it is reset.

    Attributes:
        stop_id: which a reset must name, so that a stop is reset only by those who have seen it.
        by: who or what stopped the robot, for people.
    """

    stop_id: int
    by: str
    reason: str


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What else decides about motion, as far as it is known.

    Attributes:
        preview_running: whether pictures leave the robot.
        newest_capture_ns: upper bound of when the newest picture that left the robot was captured; no driver
            has seen a later one.
        robot_stopped: the robot's own stop is active.
        base_present: something takes the velocity commands.
        outranked: the base follows another source although motion is commanded here.
        still: odometry shows no motion; None without odometry.
        sources_known: whether there was time to discover what else commands the robot.
        commanded_on: topics on which other sources command motion, whether it reaches the base or not.
    """

    preview_running: bool = False
    newest_capture_ns: int = 0
    robot_stopped: bool = False
    base_present: bool = False
    outranked: bool = False
    still: bool | None = None
    sources_known: bool = True
    commanded_on: tuple[str, ...] = ()
