"""Freshness: every measured part of an answer says whether it is there and how old it is."""

from dataclasses import dataclass
from enum import Enum


class Freshness(Enum):
    """Whether a value may be relied on."""

    MISSING = "missing"
    """Nothing was received since the gateway started."""
    STALE = "stale"
    """Older than the limit the robot is configured with."""
    FRESH = "fresh"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A measured part of an answer. While `available` is false, all values of the part are None."""

    available: bool
    stale: bool
    age_ms: int | None
    """Since the robot's gateway received it, on the gateway's monotonic clock. None when not available."""

    @property
    def freshness(self) -> Freshness:
        """The two flags in one word."""
        if not self.available:
            return Freshness.MISSING
        return Freshness.STALE if self.stale else Freshness.FRESH
