"""Sends what the outbox holds: batches of events one at a time and in order, and results of commands.

| what the hub says | what follows |
|---|---|
| delivered, or refused because it has the batch | the outbox deletes it |
| anything else, or nothing | the same again: after 1 s to 60 s with jitter, or over the next connection |

An event that the disk has changed is sent as a gap.
"""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable

from bridge.events.encoding import batch_message, is_whole
from bridge.events.values import Event
from bridge.outbox.errors import OutboxError
from bridge.outbox.outbox import Outbox
from common.jittered_backoff import JitteredBackoff
from fleet.connection import Hub, Published
from fleet.errors import HubError
from fleet.names import event_subject, result_subject

_log = logging.getLogger(__name__)


class Sender:
    """Sends until cancelled.

    Args:
        robot: its name in the fleet.
        outbox: what is to be sent.
        hub: takes it.
    """

    def __init__(self, robot: str, outbox: Outbox, hub: Hub) -> None:
        self._robot = robot
        self._outbox = outbox
        self._hub = hub
        self.last_sent_s: float | None = None
        """When the hub acknowledged a batch last; monotonic seconds."""
        self.repeats = 0
        """Batches that the hub had already."""
        self.failures = 0
        """Attempts that failed at the hub."""
        self._errors = {"events": "", "results": ""}

    @property
    def error(self) -> str:
        """Why events, or else results, are not taken, for people; empty while what there is was taken."""
        return self._errors["events"] or self._errors["results"]

    async def run(self) -> None:
        """Sends events and results."""
        async with asyncio.TaskGroup() as group:
            group.create_task(
                self._keep_sending("events", self._send_batch, lambda: self._outbox.facts), name="send-events"
            )
            group.create_task(
                self._keep_sending("results", self._send_result, lambda: self._outbox.results),
                name="send-results",
            )

    async def _keep_sending(
        self, what: str, send: Callable[[], Awaitable[bool]], kept: Callable[[], object]
    ) -> None:
        """Sends what there is, and again when the outbox keeps something new.

        Args:
            what: of `_errors`.
            send: returns False if there is nothing.
            kept: changes with whatever `send` would find.
        """
        backoff = JitteredBackoff()
        while True:
            before = kept()
            try:
                await self._hub.connected()
                found = await send()
                self._errors[what] = ""
                if not found:
                    await self._outbox.changes.wait_until(
                        lambda: kept() != before  # noqa: B023  # awaited here
                    )
                backoff.reset()
            except (HubError, OutboxError) as error:
                self.failures += isinstance(error, HubError)
                self._errors[what] = str(error)
                _log.info("it is sent again later: %s", error)
                await self._hub.pause(backoff.next_s())

    async def _send_batch(self) -> bool:
        """Sends a batch. Returns False if there is none."""
        batch = await self._outbox.next_batch()
        if batch is None:
            return False
        if changed := [each for each in batch.items if isinstance(each, Event) and not is_whole(each)]:
            numbers = [each.sequence for each in changed]
            _log.error("events of run %s that the disk has changed become gaps: %s", batch.run_id, numbers)
            await self._outbox.give_up(batch, numbers)
            return True
        subject = event_subject(self._robot, batch.run_id, batch.first)
        published = await self._hub.publish_once(subject, batch_message(self._robot, batch))
        self.last_sent_s = time.monotonic()
        self.repeats += published is Published.REPEATED
        await self._outbox.delivered(batch, repeated=published is Published.REPEATED)
        return True

    async def _send_result(self) -> bool:
        """Sends the result of a command. Returns False if there is none."""
        result = await self._outbox.next_result()
        if result is None:
            return False
        command_id, payload = result
        await self._hub.publish_once(result_subject(self._robot, command_id), payload)
        await self._outbox.result_sent(command_id)
        return True
