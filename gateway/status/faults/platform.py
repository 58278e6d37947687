"""Faults of computer, batteries and attitude, found by limits with hysteresis: noise raises no events."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from gateway.status.fault import Condition, Severity
from gateway.status.freshness import Sample
from gateway.status.limit import Limit
from gateway.status.snapshot import Snapshot
from gateway.status.sources import BATTERY, COMPUTE, NETWORK, ONBOARD_BATTERY, ORIENTATION
from gateway.status.values import Battery

_COMPUTER: Final = "computer"
_COOL_DOWN: Final = "Check fan and dust, reduce the load (preview profile), let it cool down"


@dataclass(frozen=True, slots=True)
class PlatformLimits:
    """The limits of the robot's computer, batteries and attitude."""

    temperature_c: Limit
    memory_percent: Limit
    disk_percent: Limit
    battery_percent: Limit
    wifi_signal_dbm: Limit
    tilt_deg: Limit


def platform_faults(snapshot: Snapshot, limits: PlatformLimits) -> Iterator[Condition]:
    """Yields the present conditions. An unknown or stale value is judged as the last known one was."""
    # Not all that are active: what was cured and is about to be cleared would stay for ever.
    before = frozenset(each.condition.fault_id for each in snapshot.faults if each.seen_severity)
    for value, limit, condition in _checks(snapshot, limits):
        was_broken = condition.fault_id in before
        if was_broken if value is None else limit.broken(value, was_broken=was_broken):
            yield condition
    battery = snapshot[BATTERY]
    if battery.value and battery.value.charge_out_of_range and not battery.freshness.stale:
        yield _warning(
            "battery.out_of_range",
            "power",
            "the robot's battery reports a charge outside its range: it is unknown, and no fault when low",
            "Have its publisher send percentage as 0 to 1 (sensor_msgs/BatteryState), not as 0 to 100; "
            "then restart the gateway",
        )
    yield from _throttling(snapshot, before)
    if snapshot[COMPUTE].freshness.stale or snapshot[NETWORK].freshness.stale:
        yield _warning(
            "platform.stale",
            _COMPUTER,
            "the values of the robot's computer are no longer updated",
            "Its file system may hang: check the configured platform.disk_path, then restart the gateway",
        )


def _checks(snapshot: Snapshot, limits: PlatformLimits) -> Iterator[tuple[float | None, Limit, Condition]]:
    """Yields each measured value, None if unknown, with its limit and the condition of its violation."""
    compute = snapshot[COMPUTE].value if snapshot[COMPUTE].freshness.fresh else None
    network = snapshot[NETWORK].value if snapshot[NETWORK].freshness.fresh else None
    yield (
        compute.cpu_temperature_c if compute else None,
        limits.temperature_c,
        _warning(
            "platform.temperature",
            _COMPUTER,
            f"the processor is hot: {limits.temperature_c.raise_at:g} °C or more",
            _COOL_DOWN,
        ),
    )
    yield (
        compute.ram_used_percent if compute else None,
        limits.memory_percent,
        _warning(
            "platform.memory",
            _COMPUTER,
            f"memory is nearly full: {limits.memory_percent.raise_at:g} % or more",
            "Find the largest program on the robot (top, then M) and restart it",
        ),
    )
    yield (
        compute.disk_used_percent if compute else None,
        limits.disk_percent,
        _warning(
            "platform.disk",
            _COMPUTER,
            f"the disk is nearly full: {limits.disk_percent.raise_at:g} % or more",
            "Move recordings and logs off the robot",
        ),
    )
    yield (
        network.wifi_signal_dbm if network else None,
        limits.wifi_signal_dbm,
        _warning(
            "platform.wifi",
            "network",
            f"the Wi-Fi signal is weak: {limits.wifi_signal_dbm.raise_at:g} dBm or less",
            "Move the robot closer to the access point, or select a smaller preview profile",
        ),
    )
    orientation = snapshot[ORIENTATION].value if snapshot[ORIENTATION].freshness.fresh else None
    yield (
        orientation.tilt_deg if orientation else None,
        limits.tilt_deg,
        _warning(
            "orientation.tilt",
            "orientation",
            f"the robot is tilted: {limits.tilt_deg.raise_at:g}° or more",
            "Stop it before it falls; if it stands level, check how its IMU is mounted, or faults.tilt_deg",
        ),
    )
    charge = f"is low: {limits.battery_percent.raise_at:g} % or less"
    yield (
        _charge_percent(snapshot[BATTERY]),
        limits.battery_percent,
        _warning("battery.low", "power", f"the robot's battery {charge}", "Bring the robot to its charger"),
    )
    yield (
        _charge_percent(snapshot[ONBOARD_BATTERY]),
        limits.battery_percent,
        _warning(
            "platform.battery_low", "power", f"the computer's battery {charge}", "Connect its power supply"
        ),
    )


def _warning(fault_id: str, component: str, message: str, remedy: str) -> Condition:
    return Condition(fault_id, Severity.WARNING, component, message, remedy)


def _throttling(snapshot: Snapshot, before: frozenset[str]) -> Iterator[Condition]:
    compute = snapshot[COMPUTE]
    throttled = compute.value.thermal_throttled if compute.value and compute.freshness.fresh else None
    fault_id = "platform.throttled"
    if throttled or (throttled is None and fault_id in before):
        yield _warning(fault_id, _COMPUTER, "the processor is slowed down by heat", _COOL_DOWN)


def _charge_percent(sample: Sample[Battery]) -> float | None:
    """Returns the state of charge; 100 for a battery that is charging or absent, which can't be low."""
    battery = sample.value
    if battery is None or sample.freshness.stale:
        return None
    if battery.charging or not battery.present:
        return 100.0
    return battery.charge_percent
