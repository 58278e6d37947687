"""Takes commands from the hub, one at a time, and acknowledges each when its result is on the disk."""

import asyncio
import ctypes
import logging
import time
from collections.abc import Callable
from typing import Final

from bridge.commands.hub_time import HubTime, age_s, hub_time
from bridge.commands.judgement import Denial, Judgement, Request, Stray, judge
from bridge.commands.pending_requests import Pending, PendingRequests
from bridge.config import BridgeSettings
from bridge.outbox.errors import OutboxError
from common.jittered_backoff import JitteredBackoff
from common.suspend import elapsed_s
from common.token_bucket import TokenBucket
from fleet.connection import Delivery, Hub
from fleet.errors import HubError
from fleet.names import COMMANDS, time_subject

_log = logging.getLogger(__name__)

_BURST: Final = 4.0
_PER_S: Final = 0.1
"""Requests that are handed over. A robot has no use for more."""
_BURST_OF_OTHERS: Final = 16.0
_OTHERS_PER_S: Final = 2.0
"""Those that are only answered, with a write to the disk: what has expired while the robot was away, hundreds
perhaps, keeps the next command back for minutes instead of hours."""
_LOOK_S: Final = 0.5
_TIME_GOOD_S: Final = 3600.0
"""Quartz clocks differ by less than 0.4 s in that time."""
_TIME_ERROR: Final = 5
"""Clock state of adjtimex(2): not synchronised. Setting the clock by hand causes it, too."""
_TIMEX_BYTES: Final = 512
"""More than struct timex has on any platform; zeros read without changing anything."""


class CommandConsumer:
    """Takes commands until cancelled.

    Args:
        settings: of the bridge; `commands.allowed` is not empty.
        hub: brings them.
        requests: where requests wait for the gateway.
        clock: monotonic seconds, in a suspend of the computer, too: commands grow old in it.
    """

    def __init__(
        self,
        settings: BridgeSettings,
        hub: Hub,
        requests: PendingRequests,
        clock: Callable[[], float] = elapsed_s,
    ) -> None:
        self._robot = settings.hub.robot
        self._allowed = frozenset(settings.commands.allowed)
        self._hub, self._requests, self._clock = hub, requests, clock
        self._handed_over = TokenBucket(_BURST, clock())
        self._others = TokenBucket(_BURST_OF_OTHERS, clock())
        self._time: HubTime | None = None
        self._time_of = 0
        self._waiting: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Takes commands; a failure of hub or disk is tried again for as long as it takes."""
        backoff = JitteredBackoff()
        try:
            while True:
                try:
                    await self._requests.end_those_of_an_earlier_run()
                    async for delivery in self._hub.pull(COMMANDS, self._robot, batch=1):
                        await self._take(delivery)
                        backoff.reset()
                except (HubError, OutboxError) as error:
                    # What is not acknowledged comes again.
                    _log.warning("commands of the hub wait: %s", error)
                await backoff.wait()
        finally:
            for task in self._waiting:
                task.cancel()

    async def _have_room(self) -> None:
        """Waits while as many requests are pending as may be, and for the rate limit."""
        while self._requests.is_full or not self._handed_over.take(
            self._clock(), capacity=_BURST, refill_per_s=_PER_S
        ):
            await self._requests.expire()
            await asyncio.sleep(_LOOK_S)

    async def _have_time_for_another(self) -> None:
        """Waits for the rate limit of those that are only answered."""
        while not self._others.take(self._clock(), capacity=_BURST_OF_OTHERS, refill_per_s=_OTHERS_PER_S):
            await self._requests.expire()
            await asyncio.sleep(_LOOK_S)

    async def _take(self, delivery: Delivery) -> None:
        judgement = await self._judge(delivery)
        if isinstance(judgement, Request):
            if self._requests.has(judgement.command_id):
                return  # It comes again until it is answered.
            await self._have_room()
            # It may have expired while it waited.
            judgement = await self._judge(delivery)
        else:
            await self._have_time_for_another()
        match judgement:
            case Stray(why):
                self._requests.strays += 1
                _log.warning("a message of the hub is no command to this robot: %s", why)
                await delivery.ack()
            case Denial():
                await self._deny(judgement, delivery)
            case Request():
                await self._hand_over(judgement, delivery)

    async def _judge(self, delivery: Delivery) -> Judgement:
        age = age_s(delivery.unix_s, self._clock(), await self._hub_time(), _synchronised_unix_s())
        return judge(delivery.subject, delivery.payload, robot=self._robot, allowed=self._allowed, age_s=age)

    async def _deny(self, denial: Denial, delivery: Delivery) -> None:
        # A command that waits for the gateway comes again after a while, and may have expired meanwhile.
        if not self._requests.has(denial.command_id):
            _log.warning("command %s of the hub: %s", denial.command_id, denial.message)
            await self._requests.deny(denial)
            await delivery.ack()

    async def _hand_over(self, request: Request, delivery: Delivery) -> None:
        pending = await self._requests.add(request)
        if pending is None:
            await delivery.ack()
            return
        _log.info("command %s of %s is handed to the gateway", request.command_id, request.issued_by)
        task = asyncio.create_task(self._acknowledge(pending, delivery), name=f"command {request.command_id}")
        self._waiting.add(task)
        task.add_done_callback(self._waiting.discard)

    async def _acknowledge(self, pending: Pending, delivery: Delivery) -> None:
        while not pending.ended.is_set():
            await self._requests.expire()
            try:
                async with asyncio.timeout(_LOOK_S):
                    await pending.ended.wait()
            except TimeoutError:
                continue
        try:
            await delivery.ack()
        except HubError as error:
            _log.info("command %s will come again, and be ignored: %s", pending.request.command_id, error)

    async def _hub_time(self) -> HubTime | None:
        """Returns the hub's time, asked for once in a connection and then every hour."""
        connections, now_s = self._hub.link.connections, self._clock()
        fresh = self._time is not None and now_s - self._time.asked_s < _TIME_GOOD_S
        if not fresh or connections != self._time_of:
            try:
                info = await self._hub.consumer_info(time_subject(self._robot))
            except HubError as error:
                _log.warning("the hub does not say what time it is: %s", error)
                info = None
            self._time, self._time_of = hub_time(info, now_s), connections
        return self._time


def _synchronised_unix_s() -> float | None:
    """Returns the calendar clock in seconds since 1970 UTC; None if the kernel has it not synchronised."""
    try:
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.create_string_buffer(_TIMEX_BYTES))
    except AttributeError:
        return None  # Another C library.
    return time.time() if 0 <= state < _TIME_ERROR else None
