"""The robot as a whole: health, motion, vision, commands."""

from dataclasses import dataclass
from enum import Enum

from console.client.results.fault import Fault
from console.client.results.info import GatewayFacts
from console.client.results.platform import Platform
from console.client.results.preview import PreviewStatus
from console.client.results.sample import Sample
from console.client.results.source import Source


class HealthState(Enum):
    """One word for whether the robot can be relied on."""

    UNKNOWN = "unknown"
    OK = "ok"
    DEGRADED = "degraded"


class TeleopState(Enum):
    """Whether the robot takes velocity commands from the operator."""

    UNKNOWN = "unknown"
    """The gateway has no teleoperation."""
    DISABLED = "disabled"
    ENABLED = "enabled"


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """Whether the robot can be relied on."""

    state: HealthState
    ready: bool
    summary: str
    """One sentence: the first thing that is wrong, or "robot healthy"."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Odometry(Sample):
    """How the robot moves, in its own frame: x forward, y left, turning counter-clockwise from above."""

    linear_speed_mps: float | None
    """Speed over ground, never negative."""
    angular_speed_rad_s: float | None
    """Turning speed, never negative."""
    vx_mps: float | None
    vy_mps: float | None
    wz_rad_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Vision(Sample):
    """The robot's vision process, from its own report. Counts are since that process started."""

    producer_fps: float | None
    """Frames per second taken from the camera."""
    consumer_fps: float | None
    """Frames per second evaluated."""
    last_infer_ms: float | None
    infer_error_count: int | None
    capture_fatal_error_count: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TeleopCommand(Sample):
    """The newest accepted operator command, in the robot's own frame."""

    vx_mps: float | None
    vy_mps: float | None
    wz_rad_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Teleop:
    """Operator velocity commands."""

    state: TeleopState
    enabled: bool
    max_linear_mps: float
    max_angular_rad_s: float
    last_error: str
    """Why the newest command was refused. Empty when it was not."""
    last_command: TeleopCommand


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectiveCommand(Sample):
    """The velocity command the robot is following, whoever gave it, in the robot's own frame."""

    vx_mps: float | None
    vy_mps: float | None
    wz_rad_s: float | None
    active_source: str | None
    """One of "keyboard", "autonomy", "navigation" or "unknown"."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission(Sample):
    """What the robot is about. One that tells its mode only when it changes still has it when stale."""

    mode: str | None
    """In the robot's own words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SystemStatus:
    """Everything a gateway knows about its robot, at one instant."""

    gateway_name: str
    gateway_version: str
    insecure: bool
    """Whether the gateway talks without encryption to the network, by its owner's explicit choice."""
    health: Health
    odometry: Odometry
    vision: Vision
    preview: PreviewStatus
    platform: Platform
    effective_command: EffectiveCommand
    teleop: Teleop
    faults: tuple[Fault, ...]
    """What is wrong, the worst first; then what was wrong a moment ago, the newest first."""
    mission: Mission
    sources: tuple[Source, ...]
    """Everything the gateway is configured to read."""
    gateway: GatewayFacts
