"""The robot's connection to its fleet, as operators see it: the one place where its state is decided."""

import time
from collections.abc import Callable
from typing import Final

from bridge.connection.lifecycle import Event, Phase, State, step
from bridge.connection.sender import Sender
from bridge.connection.uploading import Uploading
from bridge.outbox.outbox import Outbox
from common.broadcast import Broadcast
from fleet.connection import Hub
from fleet.errors import HubReason
from omniseer.gateway.v1 import cloud_pb2 as pb

_MS_PER_S: Final = 1000
STATES: Final = {
    State.OFFLINE: pb.CLOUD_STATE_OFFLINE,
    State.CONNECTED: pb.CLOUD_STATE_CONNECTED,
    State.REFUSED: pb.CLOUD_STATE_REFUSED,
    State.FAULTED: pb.CLOUD_STATE_FAULTED,
}
_REFUSED: Final = "Have the robot enrolled again: robot-bridge enroll NAME --out DIR, on the hub"
_DISK: Final = (
    "Events stay at the gateway, which keeps the newest 1024. Free disk space, or see robot-bridge doctor"
)


class Status:
    """Used on one event loop.

    Args:
        robot: its name in the fleet.
        fleet: the name of the fleet.
        outbox, hub, sender, uploads: what it is made of.
        changes: notified after each change that a report is worth.
        gateway: returns why the gateway's status does not come; empty while it does.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        robot: str,
        fleet: str,
        *,
        outbox: Outbox,
        hub: Hub,
        sender: Sender,
        uploads: Uploading,
        changes: Broadcast,
        gateway: Callable[[], str],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._robot, self._fleet = robot, fleet
        self._outbox, self._hub, self._sender, self._uploads = outbox, hub, sender, uploads
        self._gateway = gateway
        self.changes = changes
        self._clock = clock
        self._phase = Phase(State.OFFLINE, clock())

    def message(self) -> pb.CloudStatus:
        """Returns the status now."""
        now_s = self._clock()
        self._phase = step(self._phase, self._events(), now_s)
        facts = self._outbox.facts
        status = pb.CloudStatus(
            state=STATES[self._phase.state],
            robot=self._robot,
            fleet=self._fleet,
            state_age_ms=round((now_s - self._phase.since_s) * _MS_PER_S),
            outbox_events=facts.events,
            outbox_bytes=facts.size,
            outbox_max_bytes=self._outbox.max_bytes,
            events_dropped=facts.dropped,
            events_sent=facts.sent,
            last_error=self._last_error(),
        )
        if (sent_s := self._sender.last_sent_s) is not None:
            status.last_sent_age_ms = round((now_s - sent_s) * _MS_PER_S)
        self._uploads.describe(status)
        return status

    def _events(self) -> tuple[Event, ...]:
        link = self._hub.link
        disk = Event.DISK_FAILED if self._outbox.error else Event.DISK_WORKS
        if link.connected:
            return disk, Event.CONNECTED
        return disk, Event.REFUSED if link.reason is HubReason.REFUSED else Event.LOST

    def _last_error(self) -> str:
        link = self._hub.link
        match self._phase.state:
            case State.FAULTED:
                return f"{self._outbox.error}. {_DISK}"
            case State.REFUSED:
                return f"{link.text}. {_REFUSED}"
            case State.OFFLINE:
                return link.text or "the hub has not been reached yet"
            case State.CONNECTED:
                # It stands, and yet nothing is taken (no stream, no room, no quorum), or nothing comes.
                return self._sender.error or self._gateway()
