"""Where the robot's values come from, and whether they do."""

from dataclasses import dataclass
from enum import Enum

from console.client.results.sample import Sample


class SourceState(Enum):
    """What is known of a source."""

    UNKNOWN = "unknown"
    WAITING = "waiting"
    """Nothing has come, and nobody on the robot offers it."""
    SILENT = "silent"
    """Somebody on the robot offers it, but nothing has come."""
    RECEIVING = "receiving"
    STALE = "stale"
    """It came; the newest value is too old."""
    QOS_MISMATCH = "qos_mismatch"
    """Offered with delivery guarantees that exclude the gateway's: nothing can come."""
    WRONG_TYPE = "wrong_type"
    """Offered in another form than configured: nothing can come."""
    TYPE_MISSING = "type_missing"
    """The gateway lacks the message type: nothing can come."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source(Sample):
    """One of the sources that the gateway is configured to read."""

    name: str
    """What it tells: "odometry"."""
    state: SourceState
    required: bool
    """Whether the robot counts as degraded without it."""
    detail: str
    """The state in a sentence. Empty while all is well."""
