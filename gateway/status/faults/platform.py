"""Faults of the robot's computer and batteries."""

from collections.abc import Iterator
from dataclasses import dataclass

from gateway.status.faults.fault import Condition, Severity
from gateway.status.faults.limits import Limit, PlatformLimits
from gateway.status.freshness import Sample
from gateway.status.snapshot import Snapshot
from gateway.status.values import Battery

_COMPONENT = "computer"


@dataclass(frozen=True, slots=True)
class _Watched:
    """A figure with its limit, and what to say when it breaks it. The value is None when it is not known."""

    value: float | None
    limit: Limit
    condition: Condition


def platform_faults(
    snapshot: Snapshot, limits: PlatformLimits, active: frozenset[str]
) -> Iterator[Condition]:
    """What is wrong now; a figure that is not known (or too old) neither raises a fault nor ends one."""
    for watched in (*_compute(snapshot, limits), *_network(snapshot, limits), *_power(snapshot, limits)):
        condition = watched.condition
        was_broken = condition.fault_id in active
        if watched.value is None:
            broken = was_broken
        else:
            broken = watched.limit.broken(watched.value, was_broken=was_broken)
        if broken:
            yield condition
    yield from _throttling(snapshot, active)
    if snapshot.compute.freshness.stale or snapshot.network.freshness.stale:
        yield Condition(
            "platform.stale",
            Severity.WARNING,
            _COMPONENT,
            "the computer's own figures are not renewed",
            "Its file system may hang: look at the configured platform.disk_path, then restart the gateway",
        )


def _compute(snapshot: Snapshot, limits: PlatformLimits) -> Iterator[_Watched]:
    compute = snapshot.compute.value if snapshot.compute.freshness.fresh else None
    yield _Watched(
        compute.cpu_temperature_c if compute else None,
        limits.temperature_c,
        Condition(
            "platform.temperature",
            Severity.WARNING,
            _COMPONENT,
            f"the processor is hot: {limits.temperature_c.raise_at:g} °C or more",
            "Look at fan and dust, take load off (preview profile), let it cool down",
        ),
    )
    yield _Watched(
        compute.ram_used_percent if compute else None,
        limits.memory_percent,
        Condition(
            "platform.memory",
            Severity.WARNING,
            _COMPONENT,
            f"memory is nearly used up: {limits.memory_percent.raise_at:g} % or more",
            "Find the largest program on the robot (top, then M) and restart it",
        ),
    )
    yield _Watched(
        compute.disk_used_percent if compute else None,
        limits.disk_percent,
        Condition(
            "platform.disk",
            Severity.WARNING,
            _COMPONENT,
            f"the disk is nearly full: {limits.disk_percent.raise_at:g} % or more",
            "Move recordings and logs off the robot",
        ),
    )


def _throttling(snapshot: Snapshot, active: frozenset[str]) -> Iterator[Condition]:
    compute = snapshot.compute
    known = compute.value.thermal_throttled if compute.value and compute.freshness.fresh else None
    fault_id = "platform.throttled"
    if known or (known is None and fault_id in active):
        yield Condition(
            fault_id,
            Severity.WARNING,
            _COMPONENT,
            "the processor is slowed down by heat",
            "Look at fan and dust, take load off (preview profile), let it cool down",
        )


def _network(snapshot: Snapshot, limits: PlatformLimits) -> Iterator[_Watched]:
    network = snapshot.network.value if snapshot.network.freshness.fresh else None
    yield _Watched(
        network.wifi_signal_dbm if network else None,
        limits.wifi_signal_dbm,
        Condition(
            "platform.wifi",
            Severity.WARNING,
            "network",
            f"the Wi-Fi signal is weak: {limits.wifi_signal_dbm.raise_at:g} dBm or less",
            "Bring the robot nearer to the access point, or take a smaller preview profile",
        ),
    )


def _power(snapshot: Snapshot, limits: PlatformLimits) -> Iterator[_Watched]:
    below = f"{limits.battery_percent.raise_at:g} % or less"
    for fault_id, sample, name, remedy in (
        ("battery.low", snapshot.battery, "the robot's battery", "Bring the robot to its charger"),
        (
            "platform.battery_low",
            snapshot.onboard_battery,
            "the computer's battery",
            "Connect its power supply",
        ),
    ):
        condition = Condition(fault_id, Severity.WARNING, "power", f"{name} is low: {below}", remedy)
        yield _Watched(_charge(sample), limits.battery_percent, condition)


def _charge(sample: Sample[Battery]) -> float | None:
    """Charge in percent; a battery that charges, or is not there, is not low."""
    battery = sample.value
    if battery is None or sample.freshness.stale:
        return None
    if battery.charging or not battery.present:
        return 100.0
    return battery.charge_percent
