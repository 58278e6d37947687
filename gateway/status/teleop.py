"""Driving: what the drive program reports, and what operators see of it.

Velocities are in the body frame of REP 103; instants are ns of CLOCK_MONOTONIC, which all programs share.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from gateway.status.values import Received, Velocity


class DrivePhase(Enum):
    """Phase of driving."""

    DISABLED = "disabled"
    AVAILABLE = "available"
    ARMED = "armed"
    DRIVING = "driving"
    STOPPING = "stopping"
    INHIBITED = "inhibited"
    STOPPED = "stopped"


class DriveInhibit(Enum):
    """A reason why the robot does not move for its driver, as a sentence for people."""

    COMMAND_LATE = "no valid command of the driver arrives"
    LOOP_LATE = "the driver does not receive the robot's states"
    PICTURE_MISSING = "the driver has no picture"
    PICTURE_STALE = "the driver's picture is too old"
    ROBOT_STOP = "the robot's own stop is active"
    BASE_ABSENT = "nothing takes the velocity commands"
    OUTRANKED = "another source of commands has priority"
    DRIVE_LOST = "the robot's drive program does not answer"
    ACCESS_ENDED = "the driver's access has ended"


FOUND_BY_THE_GATEWAY: Final = frozenset({DriveInhibit.DRIVE_LOST, DriveInhibit.ACCESS_ENDED})
"""The drive program reports all others."""


class LeaseEnd(Enum):
    """Why a lease ended, as a sentence for people."""

    CLOSED = "the driver has closed it"
    LOST = "the driver's connections ended, or were silent for 2 s"
    TAKEN_OVER = "another driver has taken over"
    ACCESS_ENDED = "the driver's access has ended"
    DISABLED = "driving was disabled"


@dataclass(frozen=True, slots=True)
class StopLatch:
    """A stop that stays until it is reset.

    Attributes:
        by, reason: for people.
    """

    stop_id: int
    by: str
    reason: str
    since_ns: int


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """What the robot accepts; units are in the names."""

    max_vx_mps: float
    max_vy_mps: float
    max_wz_rad_s: float
    acceleration_mps2: float
    acceleration_rad_s2: float
    max_picture_age_ms: int
    picture_travel_m: float
    line_of_sight_mps: float
    line_of_sight_rad_s: float


@dataclass(frozen=True, slots=True)
class DriveCounters:
    """Counts since the process of the drive program started, see drive.proto."""

    commands: int = 0
    ignored: int = 0
    inhibited: int = 0
    stops: int = 0
    published: int = 0
    late_cycles: int = 0
    worker_kills: int = 0


@dataclass(frozen=True, slots=True)
class DriveEpisode:
    """A time of motion, from a hold to its end, as commanded; `ended_ns` is 0 while it lasts.

    Attributes:
        recorded: whether it is in the audit log; None of an older drive program, which does not know.
    """

    episode_id: int
    holder: str
    started_ns: int
    ended_ns: int
    distance_m: float
    turned_rad: float
    ended_by: str
    recorded: bool | None = None


@dataclass(frozen=True, slots=True)
class DriveActual:
    """The state of the drive program at `monotonic_ns`.

    Attributes:
        session_id: of the lease; empty without one.
        velocity: published.
        turn_limit_rad_s: as speed_limit_mps, of the turning rate; None of an older drive program.
        problems: of the base, for people.
        base_timeout_ms: silence after which the base stops by itself; None if it is not known.
        reset_obstacle: what keeps the stop from being reset, for people; empty when nothing does.
        enabled: whether driving is enabled, whatever the phase; None of an older drive program.
    """

    instance_id: str
    monotonic_ns: int
    applied_revision: int
    phase: DrivePhase
    inhibits: tuple[DriveInhibit, ...]
    session_id: str
    velocity: Velocity
    speed_limit_mps: float
    limits: DriveLimits
    stop: StopLatch | None = None
    counters: DriveCounters = field(default_factory=DriveCounters)
    episode: DriveEpisode | None = None
    problems: tuple[str, ...] = ()
    base_timeout_ms: int | None = None
    reset_obstacle: str = ""
    enabled: bool | None = None
    turn_limit_rad_s: float | None = None


@dataclass(frozen=True, slots=True)
class DriveView:
    """The drive program as its link sees it. Any change makes a new object.

    Attributes:
        enabled: whether driving shall be enabled.
        applied: whether the drive program has that.
        error: why it is unreachable; empty while it is reachable.
        actual: the newest report, kept while it is unreachable; None before the first.
    """

    enabled: bool
    applied: bool
    error: str
    actual: DriveActual | None

    @property
    def reachable(self) -> bool:
        """Whether the drive program answers."""
        return not self.error and self.actual is not None

    @property
    def stop(self) -> StopLatch | None:
        """The stop in force, as far as it is known."""
        return self.actual.stop if self.actual else None

    @property
    def phase(self) -> DrivePhase:
        """The phase; without a drive program no one can drive."""
        return self.actual.phase if self.actual and self.reachable else DrivePhase.DISABLED


@dataclass(frozen=True, slots=True)
class TeleopView:
    """Driving as operators see it.

    Attributes:
        inhibits: why the robot does not move for a driver; its own reasons also when no one drives.
        holder: who has the lease, for people; empty when no one drives.
        command: the newest that was accepted; None before the first.
        last_error: why the newest command was refused; empty when it was not.
    """

    drive: DriveView
    inhibits: tuple[DriveInhibit, ...] = ()
    holder: str = ""
    command: Received[Velocity] | None = None
    last_error: str = ""
