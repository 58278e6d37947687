"""All fault rules applied to one snapshot."""

from collections.abc import Iterator
from dataclasses import dataclass

from gateway.status.fault import Condition
from gateway.status.faults.access import access_faults
from gateway.status.faults.cloud import cloud_faults
from gateway.status.faults.diagnostics import diagnostics_faults
from gateway.status.faults.driving import driving_faults
from gateway.status.faults.platform import PlatformLimits, platform_faults
from gateway.status.faults.position import position_faults
from gateway.status.faults.preview import preview_faults
from gateway.status.faults.recording import recording_faults
from gateway.status.faults.sources import sampler_fault, source_faults
from gateway.status.faults.values import value_faults
from gateway.status.snapshot import Snapshot
from gateway.status.sources import DIAGNOSTICS


@dataclass(frozen=True, slots=True)
class FaultRules:
    """Parameters of the rules.

    Attributes:
        platform: limits of the computer and the batteries.
        startup_grace_s: how long after the gateway's start a source or service may be missing without a
            fault: the robot's programs take their time to start.
        expiry_days: how long before its end of validity a certificate is a fault.
        hub_offline_s: how long the fleet's hub may be away without a fault.
    """

    platform: PlatformLimits
    startup_grace_s: float
    expiry_days: float = 14.0
    hub_offline_s: float = 600.0


def conditions(
    snapshot: Snapshot, rules: FaultRules, active: frozenset[str], up_s: float
) -> Iterator[Condition]:
    """Yields the conditions that are present in the snapshot.

    Args:
        snapshot: the instant to examine.
        rules: parameters of the rules.
        active: ids of the active faults, for rules with hysteresis.
        up_s: how long the gateway has been running.
    """
    settled = up_s >= rules.startup_grace_s
    of_sources = source_faults(snapshot.sources, settled=settled)
    if snapshot.ros_stalled:
        yield sampler_fault()
        # While ROS is not read, silence accuses no publisher; what was a fault before stays one.
        of_sources = (each for each in of_sources if each.fault_id in active)
    yield from of_sources
    yield from diagnostics_faults(snapshot[DIAGNOSTICS])
    yield from preview_faults(snapshot.preview, active, settled=settled)
    yield from driving_faults(snapshot.teleop, settled=settled)
    yield from recording_faults(snapshot.recorder, snapshot.at_s, settled=settled)
    yield from cloud_faults(
        snapshot.cloud, snapshot.at_s, offline_after_s=rules.hub_offline_s, settled=settled
    )
    yield from position_faults(snapshot)
    yield from value_faults(snapshot)
    yield from platform_faults(snapshot, rules.platform)
    yield from access_faults(snapshot.access, rules.expiry_days)
