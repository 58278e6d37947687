"""The values of the sources: one frozen dataclass per kind, in SI units, free of ROS and of protobuf.

Unknown values are None. Numbers are finite: the readers discard NaN and infinity.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum, StrEnum
from typing import Final, Generic, Self, TypeVar

MAX_COMPONENTS: Final = 256
"""Components whose diagnostics are kept; beyond it those are dropped that have been silent longest."""


@dataclass(frozen=True, slots=True)
class Vision:
    """Telemetry of the vision process: rates, latency of the newest inference, error counts."""

    producer_fps: float
    consumer_fps: float
    last_infer_ms: float
    infer_error_count: int
    capture_fatal_error_count: int


@dataclass(frozen=True, slots=True)
class Detection:
    """One detected object; its box in pixels of the source image: x right, y down, origin upper left."""

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
    """The objects of one image. `count` is the number detected; `items` may hold fewer when capped."""

    source_width_px: int
    source_height_px: int
    count: int
    items: tuple[Detection, ...]

    def with_truncated(self, truncated: int) -> Self:
        """Returns the same items with the count raised by the objects that were not decoded."""
        return replace(self, count=self.count + truncated)


@dataclass(frozen=True, slots=True)
class Battery:
    """State of one battery.

    Attributes:
        present: whether it is in its place.
        charge_out_of_range: whether it reports a charge that can't be one, which is then unknown.
        in_percent: whether it has reported a charge as 0 to 100. Its 0.9 may be 0.9 %, or 90 % since its
            publisher was corrected: from then on its charge is unknown.
    """

    present: bool
    voltage_v: float | None
    charge_percent: float | None
    charging: bool | None
    charge_out_of_range: bool = False
    in_percent: bool = False

    def merged(self, newer: "Battery") -> "Battery":
        """Returns a newer state, read as after this one."""
        if not self.in_percent or newer.in_percent:
            return newer
        return replace(newer, charge_percent=None, charge_out_of_range=True, in_percent=True)


@dataclass(frozen=True, slots=True)
class Velocity:
    """A measured or commanded velocity in the robot's body frame, base_link of REP-105.

    x points forward, y left, z up (REP-103).
    """

    vx_mps: float
    vy_mps: float
    wz_rad_s: float


class CommandSource(StrEnum):
    """The inputs of the robot's command mux."""

    KEYBOARD = "keyboard"
    AUTONOMY = "autonomy"
    NAVIGATION = "navigation"


@dataclass(frozen=True, slots=True)
class Mode:
    """The robot's mode of operation under its own name: "idle", "exploring", "returning"."""

    name: str


class Fix(Enum):
    """How a satellite receiver found its position."""

    NONE = "none"
    """It has none."""
    FIX = "fix"
    SBAS = "sbas"
    """With corrections from a satellite (EGNOS, WAAS)."""
    GBAS = "gbas"
    """With corrections from a station on the ground (differential GPS, RTK)."""


@dataclass(frozen=True, slots=True)
class Position:
    """Position on the earth, in WGS 84.

    Attributes:
        fix: None if the receiver does not report it.
        latitude_deg: positive is north; None without a position, as longitude is.
        longitude_deg: positive is east.
        altitude_m: above the ellipsoid.
        horizontal_accuracy_m: distance root mean square (DRMS), the root of the two variances' sum.
        vertical_accuracy_m: standard deviation.
    """

    fix: Fix | None
    latitude_deg: float | None
    longitude_deg: float | None
    altitude_m: float | None
    horizontal_accuracy_m: float | None
    vertical_accuracy_m: float | None


@dataclass(frozen=True, slots=True)
class Orientation:
    """Orientation of the robot's body, as rotations about fixed axes x, y, z in this order (REP-103).

    All three are None where the sensor has no estimate.
    """

    roll_deg: float | None
    pitch_deg: float | None
    yaw_deg: float | None

    @property
    def tilt_deg(self) -> float | None:
        """Angle between the body's vertical axis and that of the world, 0 to 180."""
        if self.roll_deg is None or self.pitch_deg is None:
            return None
        cosine = math.cos(math.radians(self.roll_deg)) * math.cos(math.radians(self.pitch_deg))
        return math.degrees(math.acos(cosine))


@dataclass(frozen=True, slots=True)
class Number:
    """A number that the configuration names: a field of any message, in the unit of the configuration.

    Attributes:
        value: None where the newest message holds none: NaN, infinity, or a list that is too short.
    """

    value: float | None


@dataclass(frozen=True, slots=True)
class Text:
    """A text that the configuration names: one printable line of bounded length.

    Attributes:
        text: None where the newest message holds none: a list that is too short.
    """

    text: str | None


class DiagnosticLevel(Enum):
    """Level of a diagnostic status (REP-107, diagnostic_msgs/DiagnosticStatus)."""

    OK = "ok"
    WARNING = "warning"
    ERROR = "error"
    STALE = "stale"
    """The component's monitor has received nothing from it for too long."""


@dataclass(frozen=True, slots=True)
class DiagnosticItem:
    """The newest diagnostic status of one component."""

    component: str
    level: DiagnosticLevel
    message: str


@dataclass(frozen=True, slots=True)
class Diagnostics:
    """The newest status of every component; the one that reported last comes last."""

    items: tuple[DiagnosticItem, ...]

    def merged(self, newer: "Diagnostics") -> "Diagnostics":
        """Returns these statuses with those of `newer`, which replace the ones of the same components.

        A message names some of the components only (REP-107: every driver publishes its own).
        """
        items = {item.component: item for item in self.items}
        for item in newer.items:
            # Removed first: a dictionary keeps the place of a key that is assigned again.
            items.pop(item.component, None)
            items[item.component] = item
        return Diagnostics(tuple(items.values())[-MAX_COMPONENTS:])


@dataclass(frozen=True, slots=True)
class Compute:
    """The robot's computer: load, temperature, memory, disk."""

    cpu_percent: float
    cpu_temperature_c: float | None
    thermal_throttled: bool | None
    ram_used_bytes: int
    ram_total_bytes: int
    disk_used_percent: float | None

    @property
    def ram_used_percent(self) -> float:
        """Used memory in percent of the installed memory."""
        return 100.0 * self.ram_used_bytes / self.ram_total_bytes if self.ram_total_bytes else 0.0


@dataclass(frozen=True, slots=True)
class Network:
    """The network interface that leads to the operator; its name is empty when there is none."""

    interface_name: str
    connected: bool
    wifi_signal_dbm: int | None
    link_quality_percent: int | None


ValueT_co = TypeVar("ValueT_co", covariant=True)


@dataclass(frozen=True, slots=True)
class Received(Generic[ValueT_co]):
    """A value with its time of reception in seconds on the gateway's monotonic clock."""

    value: ValueT_co
    at_s: float
