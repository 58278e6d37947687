"""Faults of the position."""

from collections.abc import Iterator

from gateway.status.fault import Condition, Severity
from gateway.status.snapshot import Snapshot
from gateway.status.sources import POSITION


def position_faults(snapshot: Snapshot) -> Iterator[Condition]:
    """Yields the condition of a receiver that reports, but has no position."""
    sample = snapshot[POSITION]
    if sample.value is None or sample.freshness.stale or sample.value.latitude_deg is not None:
        return
    required = any(source.spec is POSITION and source.required for source in snapshot.sources)
    yield Condition(
        "position.no_fix",
        Severity.ERROR if required else Severity.WARNING,
        "position",
        "the satellite receiver reports no position",
        "Give it a clear view of the sky and some minutes; check its antenna",
    )
