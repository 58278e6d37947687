"""What can be known of the robot: one frozen value per source, in SI units, free of ROS and of the wire.

A value that is not known is None. Numbers are finite: readers drop NaN and infinity before they get here.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Generic, TypeVar


@dataclass(frozen=True, slots=True)
class Odometry:
    """How the robot moves, in its own frame: x forward, y left, z up."""

    vx_mps: float
    vy_mps: float
    wz_rad_s: float


@dataclass(frozen=True, slots=True)
class Vision:
    """What the vision process says of itself."""

    producer_fps: float
    consumer_fps: float
    last_infer_ms: float
    infer_error_count: int
    capture_fatal_error_count: int


@dataclass(frozen=True, slots=True)
class Detection:
    """One object, its box in pixels of the source image: x right, y down, origin upper left."""

    class_id: int
    class_name: str
    score: float
    track_id: str
    center_x_px: float
    center_y_px: float
    width_px: float
    height_px: float


@dataclass(frozen=True, slots=True)
class Detections:
    """The objects of one image. `count` is how many there were; `items` may hold fewer when capped."""

    source_width_px: int
    source_height_px: int
    count: int
    items: tuple[Detection, ...]


@dataclass(frozen=True, slots=True)
class Battery:
    """One battery."""

    present: bool
    voltage_v: float | None
    charge_percent: float | None
    charging: bool | None


@dataclass(frozen=True, slots=True)
class Velocity:
    """A velocity command, in the robot's own frame: x forward, y left, z up."""

    vx_mps: float
    vy_mps: float
    wz_rad_s: float


class CommandSource(Enum):
    """Who may command the robot: the inputs of its command mux."""

    KEYBOARD = "keyboard"
    AUTONOMY = "autonomy"
    NAVIGATION = "navigation"


@dataclass(frozen=True, slots=True)
class Mode:
    """What the robot is about, in its own words: "idle", "exploring", "returning"."""

    name: str


class DiagnosticLevel(Enum):
    """What a component of the robot says of itself."""

    OK = "ok"
    WARNING = "warning"
    ERROR = "error"
    STALE = "stale"
    """Whoever watches the component has heard nothing from it for too long."""


@dataclass(frozen=True, slots=True)
class DiagnosticItem:
    """The newest word of one component."""

    component: str
    level: DiagnosticLevel
    message: str


@dataclass(frozen=True, slots=True)
class Diagnostics:
    """The newest word of every component that spoke, whichever message it came in; who spoke last is last."""

    items: tuple[DiagnosticItem, ...]


ValueT_co = TypeVar("ValueT_co", covariant=True)


@dataclass(frozen=True, slots=True)
class Received(Generic[ValueT_co]):
    """A value and when it was received, in seconds on the gateway's monotonic clock."""

    value: ValueT_co
    at_s: float


@dataclass(frozen=True, slots=True)
class Compute:
    """The robot's computer: load, heat, memory, disk."""

    cpu_percent: float
    cpu_temperature_c: float | None
    thermal_throttled: bool | None
    ram_used_bytes: int
    ram_total_bytes: int
    disk_used_percent: float | None

    @property
    def ram_used_percent(self) -> float:
        """Memory in use, in percent of the installed."""
        return 100.0 * self.ram_used_bytes / self.ram_total_bytes if self.ram_total_bytes else 0.0


@dataclass(frozen=True, slots=True)
class Network:
    """The network interface that leads to the operator; its name is empty when there is none."""

    interface_name: str
    connected: bool
    wifi_signal_dbm: int | None
    link_quality_percent: int | None
