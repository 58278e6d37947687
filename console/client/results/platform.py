"""The robot's computer: load, heat, memory, network, batteries."""

from dataclasses import dataclass

from console.client.results.sample import Sample


@dataclass(frozen=True, slots=True, kw_only=True)
class Compute(Sample):
    """CPU, temperature, memory and disk. Values that the computer does not report are None."""

    cpu_percent: float | None
    """Load of all cores together, 0-100."""
    cpu_temperature_c: float | None
    thermal_throttled: bool | None
    """Whether the CPU clock is reduced because of heat."""
    ram_used_bytes: int | None
    ram_total_bytes: int | None
    ram_used_percent: float | None
    disk_used_percent: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Network(Sample):
    """The network interface that leads to the operator."""

    connected: bool | None
    """Whether the interface is up and has an address."""
    interface_name: str | None
    wifi_signal_dbm: int | None
    """About -30 very strong, -80 weak. None on a wire."""
    link_quality_percent: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Battery(Sample):
    """One battery."""

    source: str | None
    """The battery's name in the robot's configuration."""
    present: bool | None
    voltage_v: float | None
    charge_percent: float | None
    """State of charge, 0-100."""
    charging: bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Power:
    """The robot's batteries."""

    lipo_battery: Battery
    """The traction battery."""
    onboard_battery: Battery
    """The battery of the on-board computer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Platform:
    """The robot's computer."""

    compute: Compute
    network: Network
    power: Power
