"""The lifecycle at work: its phase, what is wrong, when the disk is tried again."""

import asyncio
import logging

from common.broadcast import Broadcast
from recorder.recording.lifecycle import Event, Phase, State, step
from recorder.recording.retries import Retries

_log = logging.getLogger(__name__)


class LifecycleRunner:
    """Keeps the phase; used on one event loop.

    Attributes:
        changes: notified of every change.
        phase: of the lifecycle.
        error: why nothing can be recorded, or why a recording was stopped; empty when all is well.
        stopped_by_disk: whether a full disk has ended a recording, and none has begun since.
        retries: of the disk, while it takes no recordings.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self.changes = Broadcast()
        self.phase = Phase(State.RECOVERING, self._loop.time())
        self.error = ""
        self.stopped_by_disk = False
        self.retries = Retries(self._loop.time)

    @property
    def state(self) -> State:
        """The phase's state."""
        return self.phase.state

    def move(self, event: Event) -> None:
        """Enters the phase that follows on an event.

        Raises:
            IllegalEventError: the state has no transition for it.
        """
        before = self.phase
        self.phase = step(before, event, self._loop.time())
        if self.phase.state is not before.state:
            _log.info("%s -> %s (%s)", before.state.value, self.phase.state.value, event.value)
        self.changes.notify_all()

    def fault(self, text: str) -> None:
        """Enters FAULTED, with what is wrong for people."""
        _log.error("%s", text)
        self.error = text
        self.retries.failed()
        self.move(Event.FAILURE)

    def close_well(self) -> None:
        """Enters IDLE after a recording that the disk has taken to its end."""
        self.move(Event.CLOSED)
        self.retries.succeeded()
        self.error = ""

    def clear(self) -> None:
        """Enters IDLE after a fault."""
        self.move(Event.CLEARED)
        self.error = ""
        self.stopped_by_disk = False

    def stopped_for_room(self) -> None:
        """Takes note that a recording was stopped in order, before the disk was full."""
        self.stopped_by_disk = True
        self.error = "recording was stopped: the disk has no room, and nothing on it may be deleted"
        _log.error("%s", self.error)
