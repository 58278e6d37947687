"""Talks to the gateway in a thread of its own, so that a window never waits for a network."""

import asyncio
import threading
import time
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager, suppress
from dataclasses import replace
from typing import Final, TypeAlias

from console.client import (
    AsyncGatewayClient,
    Backoff,
    ClientOptions,
    EventPosition,
    GatewayError,
    GatewayFailed,
    Outage,
    Unsupported,
    parse_target,
)
from console.monitor.event_lines import line_of
from console.monitor.event_log import EventLog
from console.monitor.feed import Feed, PollingFeed, Reading, Robot, pause
from console.monitor.link import Link, Phase
from console.monitor.state import MonitorState, Request, Wish

EVERY_S: Final = 0.2
"""From one look to the next: 5 a second."""
_RETRY: Final = Backoff(first_s=0.5, factor=2.0, longest_s=2.0)
# One attempt is short here: the worker goes on trying by itself, and says so.
_OPTIONS: Final = ClientOptions(answer_within_s=1.5, backoff=Backoff(give_up_after_s=0.3))

Connect: TypeAlias = Callable[[str], AbstractAsyncContextManager[Robot]]


def _connect(target: str) -> AbstractAsyncContextManager[Robot]:
    return AsyncGatewayClient(target, _OPTIONS)


class Worker:
    """Follows one robot until closed. Every method may be called from any thread and returns at once.

    Args:
        target: HOST:PORT.
        on_news: called in the worker's thread whenever `newest()` has changed; must only hand over.
        connect: makes the client, inside the worker's loop.
        retry: the pauses between attempts while the robot does not answer; they never end by themselves.

    Raises:
        UserError: the target is not an address.
    """

    def __init__(
        self, target: str, on_news: Callable[[], None], connect: Connect = _connect, retry: Backoff = _RETRY
    ) -> None:
        self.target = parse_target(target)
        self._on_news = on_news
        self._connect = connect
        self._retry = retry
        self._state = MonitorState(Link(phase=Phase.CONNECTING, since_s=time.monotonic()))
        self._thread = threading.Thread(target=self._run, name="gateway-worker", daemon=True)
        self._loop = asyncio.new_event_loop()
        self._event_log: EventLog | None = None
        self._closing = asyncio.Event()
        self._retry_now = asyncio.Event()
        self._wished = asyncio.Event()

    def start(self) -> None:
        """Begins to talk."""
        self._thread.start()

    def newest(self) -> MonitorState:
        """The newest state: a frozen value, replaced by one reference assignment."""
        return self._state

    def switch(self, wish: Wish) -> None:
        """Asks the robot for a preview, or for none. While an earlier wish is under way nothing happens."""
        self._soon(lambda: self._take(wish))

    def retry_now(self) -> None:
        """Ends the pause before the next attempt."""
        self._soon(self._retry_now.set)

    def close(self, within_s: float = 1.0) -> bool:
        """Hangs up, in the middle of whatever is under way. Whether the thread ended in time."""
        self._soon(self._closing.set)
        if self._thread.ident is None:  # never started
            self._loop.close()
            return True
        self._thread.join(within_s)
        return not self._thread.is_alive()

    def _soon(self, act: Callable[[], object]) -> None:
        # After its end the loop takes no more orders, and there is nothing left to be ordered.
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(act)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            try:
                runner.run(self._work())
            except Exception as error:
                # Our own fault must not look like a robot that stands still. The traceback goes to stderr.
                failed = GatewayFailed(
                    f"the monitor itself failed: {error!r}", "Close the window and open it again"
                )
                self._tell(
                    replace(self._state, link=replace(self._state.link, phase=Phase.LOST, trouble=failed))
                )
                raise

    async def _work(self) -> None:
        async with self._connect(self.target) as robot:
            feed = PollingFeed(robot, EVERY_S)
            tasks = [
                asyncio.create_task(work)
                for work in (
                    self._follow(feed),
                    self._serve(robot, feed),
                    self._listen(robot),
                    self._closing.wait(),
                )
            ]
            try:
                done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
            for task in done:
                task.result()

    async def _follow(self, feed: Feed) -> None:
        pauses = self._retry.pauses()
        while True:
            try:
                async for reading in feed.readings():
                    self._heard(reading)
                    pauses = self._retry.pauses()
            except GatewayError as trouble:
                pause_s = next(pauses)
                self._lost(trouble, pause_s)
                self._retry_now.clear()
                await pause(pause_s, self._retry_now)
                self._tell(replace(self._state, link=replace(self._state.link, next_try_s=None)))

    def _heard(self, reading: Reading) -> None:
        now_s, link = time.monotonic(), self._state.link
        since_s = link.since_s if link.phase is Phase.CONNECTED else now_s
        link = Link(phase=Phase.CONNECTED, since_s=since_s, answer_ms=reading.answer_ms)
        heard = replace(self._state, link=link, snapshot=reading.snapshot, received_s=now_s)
        if self._event_log:
            heard = replace(heard, events=heard.events.with_lines(self._event_log.news(reading.snapshot)))
        self._tell(heard)

    def _lost(self, trouble: GatewayError, pause_s: float) -> None:
        before = self._state.link
        link = Link(
            phase=Phase.LOST,
            since_s=self._state.received_s if before.phase is Phase.CONNECTED else before.since_s,
            trouble=trouble,
            attempts=before.attempts + 1,
            next_try_s=time.monotonic() + pause_s,
        )
        self._tell(replace(self._state, link=link))

    def _take(self, wish: Wish) -> None:
        if self._state.request is None or not self._state.request.under_way:
            self._tell(replace(self._state, request=Request(wish)))
            self._wished.set()

    async def _serve(self, robot: Robot, feed: Feed) -> None:
        while True:
            await self._wished.wait()
            self._wished.clear()
            request = self._state.request
            assert request is not None
            try:
                # What becomes of it is seen in the next snapshots.
                if request.wish.enabled:
                    outcome = await robot.enable_preview(request.wish.profile, settle_within_s=0)
                else:
                    outcome = await robot.disable_preview(settle_within_s=0)
            except GatewayError as trouble:
                done = replace(request, outcome=trouble, ended_s=time.monotonic())
            else:
                done = replace(request, outcome=outcome, ended_s=time.monotonic())
            self._tell(replace(self._state, request=done))
            feed.hurry()

    async def _listen(self, robot: Robot) -> None:
        position: EventPosition | None = None
        pauses = self._retry.pauses()
        while not self._closing.is_set():
            try:
                async for item in robot.events(position):
                    if not isinstance(item, Outage):
                        position, pauses = item.position, self._retry.pauses()
                    line = line_of(item, time.time())
                    if line:
                        self._tell(replace(self._state, events=self._state.events.with_lines([line])))
            except Unsupported:
                # An older gateway: what happened is taken from the snapshots.
                self._event_log = EventLog()
                await self._closing.wait()
            except GatewayError:
                # Why there is no connection is told by who follows the robot; here it is only tried again.
                await pause(next(pauses), self._closing)

    def _tell(self, state: MonitorState) -> None:
        self._state = state
        self._on_news()
