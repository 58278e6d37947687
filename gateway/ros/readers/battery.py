"""sensor_msgs/msg/BatteryState: NaN means "not known" throughout."""

from typing import Any

from gateway.config import SourceSettings
from gateway.ros.readers.plain import between, finite
from gateway.ros.readers.registry import reads
from gateway.status.board import SourceKind
from gateway.status.values import Battery

# POWER_SUPPLY_STATUS_* of the message; 0 (unknown) and numbers it does not define say nothing.
_CHARGING = {1: True, 2: False, 3: False, 4: False}
# A gauge that counts a little past its ends is rounding; one that is further out speaks another unit.
_TOLERANCE = 0.05


@reads("sensor_msgs/msg/BatteryState", SourceKind.BATTERY)
def from_battery_state(message: Any, source: SourceSettings) -> Battery:
    """One battery."""
    return Battery(
        present=bool(message.present),
        voltage_v=finite(message.voltage),
        charge_percent=_percent(message.percentage),
        charging=_CHARGING.get(int(message.power_supply_status)),
    )


def _percent(share: Any) -> float | None:
    """0 to 100 out of 0 to 1. A value far outside is not shown as full: it is not known."""
    value = finite(share)
    if value is None or not -_TOLERANCE <= value <= 1 + _TOLERANCE:
        return None
    return 100 * between(0.0, value, 1.0)
