"""What is said between the monitor and one robot: three tasks that outlive every connection."""

import asyncio
import time
from dataclasses import replace
from typing import Final

from console.client import Backoff, EventPosition, GatewayError, Outage, PreviewChange, Unsupported
from console.monitor.event_lines import line_of
from console.monitor.event_log import EventLog
from console.monitor.feed import Feed, Reading, Robot, pause
from console.monitor.link import Link, Phase
from console.monitor.newest import Newest
from console.monitor.pauses import Pauses
from console.monitor.state import Wish

_LOOK_FOR_LOGIN_S: Final = 0.5
"""How often it is looked, while the robot does not answer, whether another login was stored."""


class Conversation:
    """Follows the status, listens to events, passes on wishes. Belongs to the loop that made it.

    Args:
        robot: with whom.
        feed: where its snapshots come from.
        newest: takes what is learnt.
        retry: the pauses between attempts while the robot does not answer; they never end by themselves.
        refused: the same while it refuses the login.
    """

    def __init__(self, robot: Robot, feed: Feed, newest: Newest, retry: Backoff, refused: Backoff) -> None:
        self._robot = robot
        self._feed = feed
        self._newest = newest
        self._retry = retry
        self._refused = refused
        self._event_log: EventLog | None = None
        self._answering = asyncio.Event()
        self._retry_now = asyncio.Event()
        self._wished = asyncio.Event()

    def retry_now(self) -> None:
        """Ends the pause before the next attempt."""
        self._retry_now.set()

    def pass_on_wish(self) -> None:
        """There is a new request in the state."""
        self._wished.set()

    async def follow(self) -> None:
        """Snapshots, one after the other; while none comes, further attempts."""
        pauses = Pauses(self._retry, self._refused)
        while True:
            try:
                async for reading in self._feed.readings():
                    self._heard(reading)
                    pauses.reset()
            except GatewayError as trouble:
                pause_s = pauses.after(trouble)
                self._lost(trouble, pause_s)
                await self._wait_for_reason(pause_s)
                self._newest.set_link(replace(self._newest.get().link, next_try_s=None))

    async def listen(self) -> None:
        """Events, each one once. A gateway that can't stream them lists the newest in its snapshots."""
        position: EventPosition | None = None
        pauses = self._retry.pauses()
        while True:
            try:
                async for item in self._robot.events(position):
                    if not isinstance(item, Outage):
                        position, pauses = item.position, self._retry.pauses()
                    line = line_of(item, time.time())
                    if line:
                        self._newest.add_events([line])
            except Unsupported:
                self._event_log = EventLog()
                return
            except GatewayError:
                # Why there is no connection is told by who follows the status, and one who asks is enough.
                await asyncio.sleep(next(pauses))
                await self._answering.wait()

    async def serve(self) -> None:
        """Wishes, one at a time; what becomes of the preview is seen in the next snapshots."""
        while True:
            await self._wished.wait()
            self._wished.clear()
            request = self._newest.get().request
            assert request is not None
            try:
                outcome: PreviewChange | GatewayError = await self._ask(request.wish)
            except GatewayError as trouble:
                outcome = trouble
            self._newest.end_request(replace(request, outcome=outcome, ended_s=time.monotonic()))
            self._feed.hurry()

    async def _wait_for_reason(self, pause_s: float) -> None:
        """The next attempt: after the pause, when the operator wants it, or with another login."""
        self._retry_now.clear()
        ends_s = time.monotonic() + pause_s
        while True:
            await pause(min(ends_s - time.monotonic(), _LOOK_FOR_LOGIN_S), self._retry_now)
            if await self._robot.renew() or self._retry_now.is_set() or time.monotonic() >= ends_s:
                return

    async def _ask(self, wish: Wish) -> PreviewChange:
        if wish.enabled:
            return await self._robot.enable_preview(wish.profile, settle_within_s=0)
        return await self._robot.disable_preview(settle_within_s=0)

    def _heard(self, reading: Reading) -> None:
        self._answering.set()
        now_s, before = time.monotonic(), self._newest.get().link
        since_s = before.since_s if before.phase is Phase.CONNECTED else now_s
        link = Link(phase=Phase.CONNECTED, since_s=since_s, answer_ms=reading.answer_ms)
        self._newest.set_snapshot(link, reading.snapshot, now_s)
        lines = self._event_log.news(reading.snapshot) if self._event_log else []
        if lines:
            self._newest.add_events(lines)

    def _lost(self, trouble: GatewayError, pause_s: float) -> None:
        self._answering.clear()
        state = self._newest.get()
        before = state.link
        link = Link(
            phase=Phase.LOST,
            since_s=state.received_s if before.phase is Phase.CONNECTED else before.since_s,
            trouble=trouble,
            attempts=before.attempts + 1,
            next_try_s=time.monotonic() + pause_s,
        )
        self._newest.set_link(link)
