"""What the robot's components report about themselves: vision, battery, mode, diagnostics."""

import math
from typing import Any, Final

from gateway.config import SourceSettings
from gateway.ros.readers.plain import clamp, finite, finite_or_zero, one_line
from gateway.ros.readers.registry import reads
from gateway.status.sources import BATTERY, DIAGNOSTICS, MODE, VISION
from gateway.status.values import (
    MAX_COMPONENTS,
    Battery,
    DiagnosticItem,
    DiagnosticLevel,
    Diagnostics,
    Mode,
    Vision,
)

# sensor_msgs/BatteryState: POWER_SUPPLY_STATUS_CHARGING, _DISCHARGING, _NOT_CHARGING, _FULL; 0 is unknown.
_CHARGING: Final = {1: True, 2: False, 3: False, 4: False}
# A gauge slightly out of range is rounding; one further out measures in another unit.
_PERCENTAGE_TOLERANCE: Final = 0.05
# No gauge is wrong by so much: it measures in percent, though what it sends may fall below 1 later.
_LEAST_IN_PERCENT: Final = 2.0
_LEAST_VOLTAGE_V: Final = 1.0
# diagnostic_msgs/DiagnosticStatus: OK = 0, WARN = 1, ERROR = 2, STALE = 3.
_LEVELS: Final = (DiagnosticLevel.OK, DiagnosticLevel.WARNING, DiagnosticLevel.ERROR, DiagnosticLevel.STALE)
_MAX_MESSAGE_LENGTH: Final = 300


@reads("omniseer_msgs/msg/VisionPerfSummary", VISION)
def from_vision_perf(message: Any, _source: SourceSettings) -> Vision:
    """Returns rates, latest inference time and error counts. A rate that is not finite counts as 0."""
    return Vision(
        producer_fps=finite_or_zero(message.producer_fps),
        consumer_fps=finite_or_zero(message.consumer_fps),
        last_infer_ms=finite_or_zero(message.last_infer_ms),
        infer_error_count=int(message.infer_error_count),
        capture_fatal_error_count=int(message.capture_fatal_error_count),
    )


@reads("sensor_msgs/msg/BatteryState", BATTERY)
def from_battery_state(message: Any, _source: SourceSettings) -> Battery:
    """Returns the state of one battery. NaN means unknown in every field of this message."""
    voltage_v, share = finite(message.voltage), message.percentage
    if not message.present and share == 0:
        share = math.nan
    return Battery(
        # Many publishers leave fields unset, which reads false and 0: a battery with a voltage is there, and
        # one that says neither that it is there nor more than 0 % has no gauge.
        present=bool(message.present) or (voltage_v is not None and voltage_v >= _LEAST_VOLTAGE_V),
        voltage_v=voltage_v,
        charge_percent=_percent(share),
        charging=_CHARGING.get(int(message.power_supply_status)),
        charge_out_of_range=_percent(share) is None and not math.isnan(share),
        in_percent=math.isfinite(share) and share >= _LEAST_IN_PERCENT,
    )


@reads("std_msgs/msg/String", MODE)
def from_string(message: Any, _source: SourceSettings) -> Mode | None:
    """Returns the mode; None if the text is empty."""
    mode = one_line(message.data).strip()
    return Mode(mode) if mode else None


@reads("diagnostic_msgs/msg/DiagnosticArray", DIAGNOSTICS, header_and_list=True)
def from_diagnostic_array(message: Any, _source: SourceSettings) -> Diagnostics:
    """Returns the components of this message, without their key-value pairs."""
    return Diagnostics(tuple(_item(status) for status in message.status[:MAX_COMPONENTS]))


def _percent(fraction: Any) -> float | None:
    """Returns 0 to 100 for 0 to 1; None for a value far outside, rather than a battery shown as full."""
    value = finite(fraction)
    if value is None or not -_PERCENTAGE_TOLERANCE <= value <= 1 + _PERCENTAGE_TOLERANCE:
        return None
    return 100 * clamp(0.0, value, 1.0)


def _item(status: Any) -> DiagnosticItem:
    return DiagnosticItem(
        component=one_line(status.name),
        level=_level(status.level),
        message=one_line(status.message, _MAX_MESSAGE_LENGTH),
    )


def _level(level: bytes) -> DiagnosticLevel:
    """Returns the level (one byte). A number that the message does not define counts as ERROR, to be safe."""
    number = int.from_bytes(level, "little")
    return _LEVELS[number] if number < len(_LEVELS) else DiagnosticLevel.ERROR
