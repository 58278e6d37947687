"""Fault rules as the default settings have them, for tests of the pure core."""

from gateway.fault_settings import FaultSettings
from gateway.status.faults.book import FaultBook
from gateway.status.faults.rules import FaultRules
from gateway.status.observer import Observer

LIMITS = FaultSettings().platform_limits()


def new_observer(
    *, startup_grace_s: float = 0.0, clear_after_s: float = 0.0, book: FaultBook | None = None
) -> Observer:
    """An observer that misses everything at once and forgives at once, unless told otherwise."""
    return Observer(book or FaultBook(clear_after_s, 60.0), FaultRules(LIMITS, startup_grace_s))
