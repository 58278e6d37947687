"""The robot as a whole: health, motion, vision, commands; and the gateway program itself."""

from dataclasses import dataclass
from enum import Enum

from console.client.results.cloud import CloudStatus
from console.client.results.driving import DriveInhibit, DrivePhase, StopLatch
from console.client.results.fault import Fault
from console.client.results.platform import Platform
from console.client.results.pose import Orientation, Position
from console.client.results.preview import PreviewStatus
from console.client.results.recording import RecordingStatus
from console.client.results.sample import Sample, Source
from console.client.results.value import NumberValue, TextValue


class HealthState(Enum):
    """Overall health of the robot."""

    UNKNOWN = "unknown"
    OK = "ok"
    DEGRADED = "degraded"


class TeleopState(Enum):
    """Whether the robot accepts velocity commands from the operator."""

    UNKNOWN = "unknown"
    """The gateway has no teleoperation."""
    DISABLED = "disabled"
    ENABLED = "enabled"


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """Health of the robot."""

    state: HealthState
    ready: bool
    summary: str
    """One sentence: the most severe condition, or "robot healthy"."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Odometry(Sample):
    """Measured velocity in the robot's frame (REP 103): x forward, y left, turning counter-clockwise."""

    linear_speed_mps: float | None
    """Speed over ground, never negative."""
    angular_speed_rad_s: float | None
    """Turning speed, never negative."""
    vx_mps: float | None
    vy_mps: float | None
    wz_rad_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Vision(Sample):
    """Figures that the robot's vision process reports. Counts are since that process started."""

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
    """Why the newest command was refused. Empty when it was accepted."""
    last_command: TeleopCommand
    phase: DrivePhase
    inhibits: tuple[DriveInhibit, ...]
    """Why the robot does not move for a driver. Its own reasons also when no one drives."""
    holder: str
    """Who drives. Empty when no one does."""
    stop: StopLatch | None
    base_timeout_ms: int | None
    """Silence after which the base stops by itself, as configured on the robot. None if it is not known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TeleopAnswer:
    """The robot's answer to a switch of driving, or to a single command."""

    accepted: bool
    message: str
    teleop: Teleop


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectiveCommand(Sample):
    """The velocity command in effect, from any source, in the robot's frame."""

    vx_mps: float | None
    vy_mps: float | None
    wz_rad_s: float | None
    active_source: str | None
    """One of "keyboard", "autonomy", "navigation" or "unknown"."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission(Sample):
    """The robot's task. A mode that is published on change only stays valid when stale."""

    mode: str | None
    """As the robot names it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GatewayFacts:
    """Facts about the gateway program in every status. None where an older gateway does not report them."""

    revision: str | None
    """The git revision it was built from. None also where its build does not record it."""
    boot_id: str | None
    """Kernel boot ID of the robot's computer."""
    uptime_ms: int | None
    client_count: int | None
    """Connections with a call during the last 10 s."""
    requests_served: int | None
    requests_refused: int | None
    run_id: str | None
    """Identifies the run of the gateway program; event numbers start again with each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SystemStatus:
    """Status of the whole robot at one instant."""

    gateway_name: str
    gateway_version: str
    insecure: bool
    """Whether the gateway serves the network without encryption, by explicit configuration."""
    health: Health
    odometry: Odometry
    vision: Vision
    preview: PreviewStatus
    platform: Platform
    effective_command: EffectiveCommand
    teleop: Teleop
    faults: tuple[Fault, ...]
    """Active faults, the most severe first; then cleared ones, the newest first."""
    mission: Mission
    sources: tuple[Source, ...]
    """All sources in the gateway's configuration."""
    gateway: GatewayFacts
    recording: RecordingStatus | None
    """None where the robot is not set up for recording."""
    cloud: CloudStatus | None
    """None where the robot is not set up for a fleet."""
    position: Position
    orientation: Orientation
    numbers: tuple[NumberValue, ...]
    """Numbers that the robot's configuration names."""
    texts: tuple[TextValue, ...]
    """Texts that the robot's configuration names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotTime:
    """Both clocks of the robot's computer, read together."""

    monotonic_ns: int
    wall_clock_unix_ns: int
    boot_id: str | None
    """Kernel boot ID: the monotonic clock starts again with each boot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodCounts:
    """Counts of one method's calls since the gateway started."""

    method: str
    served: int
    refused: int
    failed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class GatewayInfo:
    """Build, call counts and configuration of the gateway program."""

    gateway_name: str
    gateway_version: str
    gateway: GatewayFacts
    wall_clock_unix_ms: int
    """Time on the robot's wall clock, in ms since 1970 UTC."""
    methods: tuple[MethodCounts, ...]
    configuration_json: str
    """The configuration in force, without secrets."""
