"""Where the robot is, and how it stands."""

from dataclasses import dataclass
from enum import Enum

from console.client.results.sample import Sample


class FixStatus(Enum):
    """How a satellite receiver found its position."""

    UNKNOWN = "unknown"
    NONE = "none"
    """It has no position."""
    FIX = "fix"
    SBAS = "sbas"
    """With corrections from a satellite."""
    GBAS = "gbas"
    """With corrections from a station on the ground."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Position(Sample):
    """Position on the earth (WGS 84). What the receiver does not know is None."""

    fix: FixStatus
    latitude_deg: float | None
    """North is positive."""
    longitude_deg: float | None
    """East is positive."""
    altitude_m: float | None
    """Above the ellipsoid."""
    horizontal_accuracy_m: float | None
    """Distance root mean square (DRMS)."""
    vertical_accuracy_m: float | None
    """Standard deviation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Orientation(Sample):
    """Rotations about fixed axes x, y, z (REP 103). None where the sensor has no estimate."""

    roll_deg: float | None
    """Positive: the right side is down."""
    pitch_deg: float | None
    """Positive: the nose is down."""
    yaw_deg: float | None
    """Counter-clockwise seen from above."""
