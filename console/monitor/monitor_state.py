"""State of the monitor window, as one frozen value that a thread can hand to another."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from console.client import Clock, DesiredPreview, GatewayError, OverlaySnapshot, PreviewChange
from console.monitor.event_log import EventLog
from console.monitor.link import Link, LinkState

_MS_PER_S = 1000
# A connection that is up may still be slow; an older snapshot is shown as outdated.
_OUTDATED_AFTER_MS = 2000


@dataclass(frozen=True, slots=True)
class PreviewRequest:
    """A request to the robot, and its outcome.

    Args:
        desired: what was asked for.
        outcome: the robot's answer, or why there is none; None while it is pending.
        ended_s: when the outcome came, on the monotonic clock.
    """

    desired: DesiredPreview
    outcome: PreviewChange | GatewayError | None = None
    ended_s: float = 0.0

    @property
    def pending(self) -> bool:
        """Whether the robot is still to answer."""
        return self.outcome is None


@dataclass(frozen=True, slots=True)
class MonitorState:
    """Latest state of the connection, the robot and the operator's request.

    Args:
        link: the connection.
        snapshot: the latest one; None before the first.
        received_s: when it came, on the monotonic clock.
        request: the latest request; None before the first.
        events: the log of events.
        heard_s: when the robot last answered anything, on the monotonic clock. It streams its status on every
            change, so that an answer of any kind shows that the snapshot still holds.
        clock: estimates the robot's clock; None before the first ping. Not frozen: each ping improves it.
    """

    link: Link
    snapshot: OverlaySnapshot | None = None
    received_s: float = 0.0
    request: PreviewRequest | None = None
    events: EventLog = field(default_factory=EventLog)
    heard_s: float = 0.0
    clock: Clock | None = None

    def with_outcome(self, ended: PreviewRequest) -> "MonitorState":
        """Returns the state after the end of the request; it carries the preview's newest status."""
        snapshot, outcome = self.snapshot, ended.outcome
        if snapshot and isinstance(outcome, PreviewChange) and outcome.accepted:
            snapshot = replace(snapshot, status=replace(snapshot.status, preview=outcome.preview))
        return replace(self, request=ended, snapshot=snapshot)

    def snapshot_age_ms(self, now_s: float) -> int:
        """Returns the time since the snapshot came; to be added to the ages in it."""
        return max(0, round((now_s - self.received_s) * _MS_PER_S))

    def outdated(self, now_s: float) -> bool:
        """Whether the snapshot is too old, or its connection lost, to count as the robot's present state."""
        return self.link.state is not LinkState.CONNECTED or self.snapshot_age_ms(now_s) > _OUTDATED_AFTER_MS


class LatestState:
    """The latest state. Thread-safe: each change replaces the frozen value at once.

    Args:
        first: the initial state.
        on_change: called by `update` after each change; must only hand over.
    """

    def __init__(self, first: MonitorState, on_change: Callable[[], None]) -> None:
        self._state = first
        self._on_change = on_change
        self._lock = threading.Lock()

    def get(self) -> MonitorState:
        """Returns the latest state."""
        return self._state

    def change(self, change: Callable[[MonitorState], MonitorState]) -> bool:
        """Replaces the state without a report. Returns whether it is another object now."""
        with self._lock:
            before, self._state = self._state, change(self._state)
            return self._state is not before

    def update(self, change: Callable[[MonitorState], MonitorState]) -> None:
        """Replaces the state and reports it. For one thread only: the reports are then in order."""
        self.change(change)
        self._on_change()
