"""The requests of the hub that wait for the gateway's answer, and how they end."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from bridge.commands.judgement import Denial, Request
from bridge.outbox.errors import OutboxError
from bridge.outbox.outbox import Outbox
from common.errors import NotFoundError
from common.reasons import Reason
from common.suspend import elapsed_s
from omniseer.fleet.v1 import command_pb2 as pb

MOST_PENDING: Final = 4
ANSWER_WITHIN_S: Final = 8.0
"""For the answer to a request that was begun in time, from the end of that time. Operators wait for 10 s."""


@dataclass(frozen=True, slots=True)
class Pending:
    """A request that the gateway is to answer.

    Attributes:
        until_s: until when it may be begun; monotonic seconds.
        ended: set once its result is on the disk.
    """

    request: Request
    until_s: float
    ended: asyncio.Event


class PendingRequests:
    """Used on one event loop.

    Args:
        robot: its name in the fleet.
        outbox: keeps the results until the hub has them.
        changed: called after each change of `pending`.
        clock: monotonic seconds, in a suspend of the computer, too.
    """

    def __init__(
        self,
        robot: str,
        outbox: Outbox,
        changed: Callable[[], None],
        clock: Callable[[], float] = elapsed_s,
    ) -> None:
        self._robot = robot
        self._outbox = outbox
        self._changed = changed
        self._clock = clock
        self._pending: dict[str, Pending] = {}
        self.strays = 0
        """Messages that were no command to this robot."""
        self.denied = 0
        """Commands that were refused, or had expired, without being handed to the gateway."""

    @property
    def pending(self) -> tuple[Pending, ...]:
        """Those that may still be begun, the oldest first."""
        now_s = self._clock()
        return tuple(each for each in self._pending.values() if each.until_s > now_s)

    def remaining_s(self, pending: Pending) -> float:
        """Returns for how long it may still be begun; 0 where it may not be any more."""
        return max(pending.until_s - self._clock(), 0.0)

    @property
    def is_full(self) -> bool:
        """Whether as many wait as may."""
        return len(self._pending) >= MOST_PENDING

    def has(self, command_id: str) -> bool:
        """Returns whether this one has no result yet."""
        return command_id in self._pending

    async def add(self, request: Request) -> Pending | None:
        """Adds a request, on the disk before it is handed over. Returns None if it is known already.

        Raises:
            OutboxError: it is not added.
        """
        until_s = self._clock() + request.remaining_s
        if not await self._outbox.begin_command(request.command_id):
            return None
        pending = Pending(request, until_s, asyncio.Event())
        self._pending[request.command_id] = pending
        self._changed()
        return pending

    async def deny(self, denial: Denial) -> None:
        """Answers a command that is not handed over.

        Raises:
            OutboxError: it is not answered.
        """
        await self._keep(denial.command_id, denial.outcome, denial.message)
        self.denied += 1

    async def answer(
        self, command_id: str, outcome: pb.CommandOutcome.ValueType, message: str, recording_id: str = ""
    ) -> None:
        """Ends a request; returns when its result is on the disk.

        Raises:
            NotFoundError: there is no such request any more.
            OutboxError: it has no result yet.
        """
        pending = self._pending.get(command_id)
        if pending is None:
            raise NotFoundError(f"the hub has no request {command_id}", Reason.RECORDING_NOT_FOUND)
        await self._keep(command_id, outcome, message, recording_id)
        pending.ended.set()
        self._pending.pop(command_id, None)
        self._changed()

    async def expire(self) -> None:
        """Ends the requests that may not be begun any more; tried again if the disk refuses.

        Not before what the gateway has begun in time may have been answered.
        """
        now_s = self._clock()
        for each in tuple(self._pending.values()):
            if each.until_s + ANSWER_WITHIN_S <= now_s:
                why = "the robot's gateway did not answer in time"
                try:
                    await self.answer(each.request.command_id, pb.COMMAND_OUTCOME_EXPIRED, why)
                except (OutboxError, NotFoundError):
                    continue

    async def end_those_of_an_earlier_run(self) -> None:
        """Answers what was handed over before the bridge was restarted, and is not handed over again.

        Raises:
            OutboxError: some have no result yet.
        """
        for command_id in await self._outbox.unanswered_commands():
            if command_id not in self._pending:
                why = "the bridge was restarted before it had an answer; it may have been carried out"
                await self._keep(command_id, pb.COMMAND_OUTCOME_FAILED, why)

    async def _keep(
        self, command_id: str, outcome: pb.CommandOutcome.ValueType, message: str, recording_id: str = ""
    ) -> None:
        result = pb.CommandResult(
            command_id=command_id,
            robot=self._robot,
            outcome=outcome,
            message=message[:1000],
            recording_id=recording_id[:128],
        )
        await self._outbox.end_command(command_id, result.SerializeToString(deterministic=True))
