"""Values that the robot's configuration names."""

from dataclasses import dataclass
from enum import Enum

from console.client.results.sample import Sample


class NumberLevel(Enum):
    """How good a number is, by the limits of the robot's configuration."""

    UNKNOWN = "unknown"
    """There is no number."""
    GOOD = "good"
    """Within its limits, or without any."""
    WARNING_LOW = "warning_low"
    WARNING_HIGH = "warning_high"
    ERROR_LOW = "error_low"
    ERROR_HIGH = "error_high"


class TextLevel(Enum):
    """How bad a text is, by the robot's configuration."""

    UNKNOWN = "unknown"
    """There is no text."""
    GOOD = "good"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True, kw_only=True)
class TextValue(Sample):
    """A text that the robot's configuration names."""

    label: str
    """Short and stable: "gripper"; its source is "text.gripper"."""
    title: str
    """Its name for people."""
    text: str | None
    """One line. None also where the newest message holds no text."""
    level: TextLevel
    tile: bool
    """Whether the robot's configuration wants it shown over the picture, too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberValue(Sample):
    """A number that the robot's configuration names. Limits are None where there is no such limit."""

    label: str
    """Short and stable: "motor_temperature"; its source is "number.motor_temperature"."""
    title: str
    """Its name for people."""
    value: float | None
    """In `unit`. None also where the newest message holds no number."""
    unit: str
    """Empty for a number without one."""
    decimals: int | None
    """Digits behind the point to show. None: as many as it takes."""
    level: NumberLevel
    error_below: float | None
    """From this number on, downwards, it is an error."""
    warning_below: float | None
    warning_above: float | None
    """From this number on, upwards, it is a warning."""
    error_above: float | None
    tile: bool
    """As of a text."""
