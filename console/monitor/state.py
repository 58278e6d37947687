"""Everything the window is drawn from, as one frozen value that a thread can hand to another."""

from dataclasses import dataclass, field

from console.client import GatewayError, OverlaySnapshot, PreviewChange, PreviewProfile
from console.monitor.event_lines import EventTrail
from console.monitor.link import Link, Phase

_MS_PER_S = 1000
# A link that is up may still be slow; what is older than this is shown as old.
_SILENT_AFTER_MS = 2000


@dataclass(frozen=True, slots=True)
class Wish:
    """What the operator wants of the preview. `UNKNOWN` leaves the profile to the robot."""

    enabled: bool
    profile: PreviewProfile = PreviewProfile.UNKNOWN


@dataclass(frozen=True, slots=True)
class Request:
    """A wish on its way to the robot, or what became of it.

    Args:
        wish: what was asked.
        outcome: the robot's answer, or why there is none; None while it is under way.
        ended_s: when the outcome came, on the monotonic clock.
    """

    wish: Wish
    outcome: PreviewChange | GatewayError | None = None
    ended_s: float = 0.0

    @property
    def under_way(self) -> bool:
        """Whether the robot is still to answer."""
        return self.outcome is None


@dataclass(frozen=True, slots=True)
class MonitorState:
    """The newest of everything.

    Args:
        link: the connection.
        snapshot: the newest that came; None before the first.
        received_s: when it came, on the monotonic clock.
        request: the newest wish; None before the first.
        events: what happened.
    """

    link: Link
    snapshot: OverlaySnapshot | None = None
    received_s: float = 0.0
    request: Request | None = None
    events: EventTrail = field(default_factory=EventTrail)

    def silent_ms(self, now_s: float) -> int:
        """How long ago the snapshot came; to be added to the ages in it."""
        return max(0, round((now_s - self.received_s) * _MS_PER_S))

    def outdated(self, now_s: float) -> bool:
        """Whether the snapshot says how the robot was, not how it is."""
        return self.link.phase is not Phase.CONNECTED or self.silent_ms(now_s) > _SILENT_AFTER_MS
