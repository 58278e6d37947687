"""The robot's computer and batteries as messages of the contract."""

from typing import Final

from gateway.rpc.mapping.freshness import freshness_fields
from gateway.status.freshness import Sample
from gateway.status.snapshot import Snapshot
from gateway.status.sources import BATTERY, COMPUTE, NETWORK, ONBOARD_BATTERY
from gateway.status.values import Battery, Compute, Network
from omniseer.gateway.v1 import platform_pb2 as pb

# The batteries under the names that operators use; never a topic or a device.
_TRACTION: Final = "robot"
_ONBOARD: Final = "computer"


def platform_status(snapshot: Snapshot) -> pb.PlatformStatus:
    """Returns all parts, each with its own freshness."""
    return pb.PlatformStatus(
        compute=_compute(snapshot[COMPUTE]),
        network=_network(snapshot[NETWORK]),
        power=pb.PowerStatus(
            lipo_battery=_battery(snapshot[BATTERY], _TRACTION),
            onboard_battery=_battery(snapshot[ONBOARD_BATTERY], _ONBOARD),
        ),
    )


def _compute(sample: Sample[Compute]) -> pb.ComputeStatus:
    value = sample.value
    if value is None:
        return pb.ComputeStatus()
    return pb.ComputeStatus(
        **freshness_fields(sample.freshness),
        cpu_percent=value.cpu_percent,
        cpu_temperature_available=value.cpu_temperature_c is not None,
        cpu_temperature_c=value.cpu_temperature_c or 0.0,
        thermal_throttled_available=value.thermal_throttled is not None,
        thermal_throttled=value.thermal_throttled or False,
        ram_used_bytes=value.ram_used_bytes,
        ram_total_bytes=value.ram_total_bytes,
        ram_used_percent=value.ram_used_percent,
        disk_available=value.disk_used_percent is not None,
        disk_used_percent=value.disk_used_percent or 0.0,
    )


def _network(sample: Sample[Network]) -> pb.NetworkStatus:
    value = sample.value
    if value is None:
        return pb.NetworkStatus()
    return pb.NetworkStatus(
        **freshness_fields(sample.freshness),
        connected=value.connected,
        interface_name=value.interface_name,
        wifi_signal_available=value.wifi_signal_dbm is not None,
        wifi_signal_dbm=value.wifi_signal_dbm or 0,
        link_quality_available=value.link_quality_percent is not None,
        link_quality_percent=value.link_quality_percent or 0,
    )


def _battery(sample: Sample[Battery], source: str) -> pb.BatteryStatus:
    value = sample.value
    if value is None:
        return pb.BatteryStatus(source=source)
    return pb.BatteryStatus(
        **freshness_fields(sample.freshness),
        source=source,
        present=value.present,
        voltage_available=value.voltage_v is not None,
        voltage=value.voltage_v or 0.0,
        percentage_available=value.charge_percent is not None,
        percentage=value.charge_percent or 0.0,
        charging_available=value.charging is not None,
        charging=value.charging or False,
    )
