"""CPU load, temperature, throttling, memory and disk of the computer."""

from pathlib import Path
from typing import Final

import psutil

from gateway.platform.files import number, text
from gateway.status.values import Compute

_CPU_ZONES: Final = ("cpu", "core", "soc", "x86_pkg", "package")
"""Parts of the type of a processor's thermal zone ("bigcore0-thermal", "x86_pkg_temp")."""
_CPU_CHIPS: Final = frozenset({"coretemp", "k10temp", "zenpower", "cpu_thermal"})
"""Names of the hardware monitors of processors without a thermal zone."""
_CPU_COOLERS: Final = ("cpufreq", "thermal-cpufreq", "processor")
"""Types of cooling devices that reduce the clock rate, which a fan does not."""
_PI_THROTTLED: Final = "devices/platform/soc/soc:firmware/get_throttled"
"""Flags of a Raspberry Pi's firmware, which throttles by itself; hexadecimal."""
_PI_SLOWED_BY_HEAT: Final = 0b1100
"""Bits 2 and 3: currently throttled, soft temperature limit active (vcgencmd get_throttled)."""
_PLAUSIBLE_C: Final = range(-40, 151)


def read(disk_path: Path, sys: Path = Path("/sys")) -> Compute:
    """Samples the computer; the CPU load is the average since the previous call.

    Args:
        disk_path: a path on the file system whose usage is sampled.
        sys: mount point of sysfs.
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
    """Reads the processor's counters, from which the first call of `read` measures the load."""
    psutil.cpu_percent(interval=None)


def temperature_c(sys: Path) -> float | None:
    """Returns the temperature of the hottest processor sensor in degrees Celsius; None without a sensor."""
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
    """Returns whether a processor is throttled because of heat; None if the machine does not report it."""
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
