"""The battery of the computer itself, as its operating system tells it."""

from pathlib import Path
from typing import Final

from gateway.platform.files import number, text
from gateway.status.values import Battery

_CHARGING: Final = {"Charging": True, "Full": False, "Discharging": False, "Not charging": False}


def read(sys: Path = Path("/sys")) -> Battery | None:
    """The first battery that feeds the computer; None when it has none (a mouse's does not count)."""
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
