"""Fault rules as the default settings have them, for tests of the pure core."""

from gateway.config.faults import FaultSettings
from gateway.observer import Observer
from gateway.status.faults.rules import FaultRules
from gateway.status.faults.tracker import FaultTracker

LIMITS = FaultSettings().platform_limits()


def new_observer(
    *, startup_grace_s: float = 0.0, clear_after_s: float = 0.0, tracker: FaultTracker | None = None
) -> Observer:
    """An observer without grace periods: faults are raised and cleared at once."""
    return Observer(tracker or FaultTracker(clear_after_s, 60.0), FaultRules(LIMITS, startup_grace_s))
