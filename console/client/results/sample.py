"""Freshness of measured values."""

from dataclasses import dataclass
from enum import Enum


class Freshness(Enum):
    """Freshness of a value."""

    MISSING = "missing"
    """Nothing was received since the gateway started."""
    STALE = "stale"
    """Older than the limit in the robot's configuration."""
    FRESH = "fresh"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A measured part of an answer. All its values are None while `available` is false."""

    available: bool
    stale: bool
    age_ms: int | None
    """Time since the gateway received it, on its monotonic clock. None when not available."""

    @property
    def freshness(self) -> Freshness:
        """Both flags as one value."""
        if not self.available:
            return Freshness.MISSING
        return Freshness.STALE if self.stale else Freshness.FRESH
