"""CPU load, heat, memory and disk."""

from pathlib import Path
from typing import Final

import psutil

from gateway.platform.files import number, text
from gateway.status.values import Compute

_CPU_ZONES: Final = ("cpu", "core", "soc", "x86_pkg", "package")
"""What thermal zones of processors have in their type ("bigcore0-thermal", "x86_pkg_temp")."""
_CPU_CHIPS: Final = frozenset({"coretemp", "k10temp", "zenpower", "cpu_thermal"})
"""Hardware monitors of processors that have no thermal zone."""
_CPU_COOLERS: Final = ("cpufreq", "thermal-cpufreq", "processor")
"""Cooling devices that cool by clocking down; a fan is none of them."""
_PI_THROTTLED: Final = "devices/platform/soc/soc:firmware/get_throttled"
"""Where a Raspberry Pi's firmware tells, in hexadecimal; it slows down without asking the kernel."""
_PI_SLOWED_BY_HEAT: Final = 0b1100
"""Its bits for "throttled" and "soft temperature limit" at this moment."""
_PLAUSIBLE_C: Final = range(-40, 151)


def read(disk_path: Path, sys: Path = Path("/sys")) -> Compute:
    """What is true now; the CPU load is that since the previous call.

    Args:
        disk_path: on the file system whose fill level counts.
        sys: where the kernel shows its devices.
    """
    memory = psutil.virtual_memory()
    return Compute(
        cpu_percent=psutil.cpu_percent(interval=None),
        cpu_temperature_c=temperature_c(sys),
        thermal_throttled=throttled(sys),
        ram_used_bytes=memory.total - memory.available,
        ram_total_bytes=memory.total,
        disk_used_percent=_disk_used_percent(disk_path),
    )


def begin() -> None:
    """Notes where the processor's counters stand: the first call of `read` tells the load since then."""
    psutil.cpu_percent(interval=None)


def temperature_c(sys: Path) -> float | None:
    """The hottest processor sensor; None when the machine has none."""
    zones = [
        number(zone / "temp")
        for zone in sys.glob("class/thermal/thermal_zone*")
        if any(part in (text(zone / "type") or "").lower() for part in _CPU_ZONES)
    ]
    chips = [
        number(sensor)
        for chip in sys.glob("class/hwmon/hwmon*")
        if text(chip / "name") in _CPU_CHIPS
        for sensor in chip.glob("temp*_input")
    ]
    known = [milli / 1000 for milli in zones + chips if milli is not None and milli // 1000 in _PLAUSIBLE_C]
    return max(known, default=None)


def throttled(sys: Path) -> bool | None:
    """Whether a processor is clocked down because of heat; None when the machine doesn't tell."""
    states = [
        number(cooler / "cur_state")
        for cooler in sys.glob("class/thermal/cooling_device*")
        if (text(cooler / "type") or "").lower().startswith(_CPU_COOLERS)
    ]
    known = [state > 0 for state in states if state is not None]
    firmware = _firmware_throttles(sys)
    if firmware is not None:
        known.append(firmware)
    return any(known) if known else None


def _firmware_throttles(sys: Path) -> bool | None:
    try:
        return bool(int(text(sys / _PI_THROTTLED) or "", 16) & _PI_SLOWED_BY_HEAT)
    except ValueError:
        return None


def _disk_used_percent(path: Path) -> float | None:
    try:
        return float(psutil.disk_usage(str(path)).percent)
    except OSError:
        return None
