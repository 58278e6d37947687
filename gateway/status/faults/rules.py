"""Everything that is wrong at one instant."""

from collections.abc import Iterator
from dataclasses import dataclass

from gateway.status.faults.access import access_faults
from gateway.status.faults.diagnostics import diagnostics_faults
from gateway.status.faults.fault import Condition
from gateway.status.faults.limits import PlatformLimits
from gateway.status.faults.platform import platform_faults
from gateway.status.faults.preview import preview_faults
from gateway.status.faults.sources import source_faults
from gateway.status.snapshot import Snapshot


@dataclass(frozen=True, slots=True)
class FaultRules:
    """What counts as wrong.

    Attributes:
        platform: what the computer and the batteries should stay within.
        startup_grace_s: how long after the gateway's start nobody is missed: a robot takes its time.
        expiry_days: how long before its end a certificate is a fault.
    """

    platform: PlatformLimits
    startup_grace_s: float
    expiry_days: float = 14.0


def conditions(
    snapshot: Snapshot, rules: FaultRules, active: frozenset[str], up_s: float
) -> Iterator[Condition]:
    """What is wrong now.

    Args:
        snapshot: this instant.
        rules: what counts as wrong.
        active: ids of the faults that are active.
        up_s: how long the gateway has been running.
    """
    settled = up_s >= rules.startup_grace_s
    yield from source_faults(snapshot.sources, settled=settled)
    yield from diagnostics_faults(snapshot.diagnostics)
    yield from preview_faults(snapshot.preview, active, settled=settled)
    yield from platform_faults(snapshot, rules.platform, active)
    yield from access_faults(snapshot.access, rules.expiry_days)
