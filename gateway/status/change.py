"""What counts as a change of the status: everything an operator would act on, and no age.

Two snapshots whose `essence` is equal tell the same story at two instants. Left out are ages (they grow by
themselves), the uptime, and the counts of calls and clients (a watcher's own looks would be news to it).
"""

from dataclasses import replace
from typing import Any

from gateway.status.freshness import Sample
from gateway.status.snapshot import Snapshot


def essence(snapshot: Snapshot) -> tuple[Any, ...]:
    """To be compared with another one; nothing else."""
    return (
        snapshot.identity,
        snapshot.health,
        _value(snapshot.odometry),
        _value(snapshot.vision),
        _value(snapshot.battery),
        _value(snapshot.mode),
        _value(snapshot.command),
        _value(snapshot.compute),
        _value(snapshot.network),
        _value(snapshot.onboard_battery),
        replace(snapshot.preview, measured=None),
        _value(snapshot.preview_measured),
        tuple(
            (source.name, source.state, source.freshness.stale, source.detail) for source in snapshot.sources
        ),
        tuple((fault.condition, fault.onset_s, fault.cleared_s) for fault in snapshot.faults),
    )


def _value(sample: Sample[Any]) -> tuple[Any, bool]:
    return sample.value, sample.freshness.stale
