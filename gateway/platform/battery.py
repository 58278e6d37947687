"""The battery of the computer itself, as reported by the kernel (sysfs class power_supply)."""

from pathlib import Path
from typing import Final

from gateway.platform.files import number, text
from gateway.status.values import Battery

_CHARGING: Final = {"Charging": True, "Full": False, "Discharging": False, "Not charging": False}


def read(sys: Path = Path("/sys")) -> Battery | None:
    """Returns the first battery that powers the computer, not one of a peripheral; None if there is none."""
    for supply in sorted(sys.glob("class/power_supply/*")):
        if text(supply / "type") == "Battery" and text(supply / "scope") != "Device":
            return _battery(supply)
    return None


def _battery(supply: Path) -> Battery:
    microvolts = number(supply / "voltage_now")
    percent = number(supply / "capacity")
    return Battery(
        present=number(supply / "present") != 0,
        voltage_v=None if microvolts is None else microvolts / 1_000_000,
        charge_percent=None if percent is None else float(percent),
        charging=_CHARGING.get(text(supply / "status") or ""),
    )
