"""Measured values, their freshness, and the sources that they come from."""

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


class SourceState(Enum):
    """State of a source."""

    UNKNOWN = "unknown"
    WAITING = "waiting"
    """Nothing was received, and nothing on the robot publishes it."""
    SILENT = "silent"
    """It has a publisher, but nothing was received."""
    RECEIVING = "receiving"
    STALE = "stale"
    """The newest value is too old."""
    QOS_MISMATCH = "qos_mismatch"
    """The publisher's QoS is incompatible with the gateway's: nothing can be received."""
    WRONG_TYPE = "wrong_type"
    """Published with another type than configured: nothing can be received."""
    TYPE_MISSING = "type_missing"
    """The gateway lacks the message type: nothing can be received."""
    FIELD_MISSING = "field_missing"
    """The message type lacks the field that the gateway is configured for."""
    UNDECODABLE = "undecodable"
    """Messages arrive, but the robot's type has other fields than the gateway's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source(Sample):
    """One source in the gateway's configuration."""

    name: str
    """What it measures: "odometry"."""
    state: SourceState
    required: bool
    """Whether the robot is degraded without it."""
    detail: str
    """The state as a sentence. Empty while it is received."""
