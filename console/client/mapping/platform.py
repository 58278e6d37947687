"""The robot's computer, from the contract's messages."""

from console.client.mapping.values import number_when, sample, when
from console.client.results import Battery, Compute, Network, Platform, Power
from omniseer.gateway.v1 import platform_pb2 as wire


def platform(message: wire.PlatformStatus) -> Platform:
    """Returns load, memory, network and batteries."""
    return Platform(
        compute=_compute(message.compute),
        network=_network(message.network),
        power=Power(
            lipo_battery=_battery(message.power.lipo_battery),
            onboard_battery=_battery(message.power.onboard_battery),
        ),
    )


def _compute(message: wire.ComputeStatus) -> Compute:
    here = message.available
    return Compute(
        **sample(message),
        cpu_percent=number_when(here, message.cpu_percent),
        cpu_temperature_c=number_when(here and message.cpu_temperature_available, message.cpu_temperature_c),
        thermal_throttled=when(here and message.thermal_throttled_available, message.thermal_throttled),
        ram_used_bytes=when(here, message.ram_used_bytes),
        ram_total_bytes=when(here, message.ram_total_bytes),
        ram_used_percent=number_when(here, message.ram_used_percent),
        disk_used_percent=number_when(here and message.disk_available, message.disk_used_percent),
    )


def _network(message: wire.NetworkStatus) -> Network:
    here = message.available
    return Network(
        **sample(message),
        connected=when(here, message.connected),
        interface_name=when(here, message.interface_name),
        wifi_signal_dbm=when(here and message.wifi_signal_available, message.wifi_signal_dbm),
        link_quality_percent=when(here and message.link_quality_available, message.link_quality_percent),
    )


def _battery(message: wire.BatteryStatus) -> Battery:
    here = message.available
    return Battery(
        **sample(message),
        source=when(here, message.source),
        present=when(here, message.present),
        voltage_v=number_when(here and message.voltage_available, message.voltage),
        charge_percent=number_when(here and message.percentage_available, message.percentage),
        charging=when(here and message.charging_available, message.charging),
    )
