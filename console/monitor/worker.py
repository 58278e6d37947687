"""Talks to the gateway in a thread of its own, so that a window never waits for a network."""

import asyncio
import threading
import time
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager, suppress
from dataclasses import replace
from typing import Final, TypeAlias

from console.client import Backoff, ClientOptions, Credentials, GatewayFailed, parse_target
from console.monitor.conversation import Conversation
from console.monitor.feed import PollingFeed, Robot
from console.monitor.link import Link, Phase
from console.monitor.newest import Newest
from console.monitor.renewed import Login, RenewedClient
from console.monitor.state import MonitorState, Wish

EVERY_S: Final = 0.1
"""From one look to the next: boxes over the picture are at most so much older than need be."""
_RETRY: Final = Backoff(first_s=0.5, factor=2.0, longest_s=2.0)
# A refused login becomes good again by the robot's keeper or its clock, not by being shown often.
_REFUSED: Final = Backoff(first_s=5.0, factor=2.0, longest_s=60.0)
# One attempt is short here: the worker goes on trying by itself, and says so.
_OPTIONS: Final = ClientOptions(answer_within_s=1.5, backoff=Backoff(give_up_after_s=0.3))

Connect: TypeAlias = Callable[[str], AbstractAsyncContextManager[Robot]]


def connecting(login: Login | None = None) -> Connect:
    """Makes clients that show what is stored for the robot; by default nothing.

    Raises:
        UserError: what is stored can't be used.
    """
    login = login or Credentials
    shown = login()
    return lambda target: RenewedClient(target, _OPTIONS, login, shown)


class Worker:
    """Follows one robot until closed. Every method may be called from any thread; only `close` waits.

    Args:
        target: HOST:PORT.
        on_news: called in the worker's thread whenever `newest()` has changed; must only hand over.
        connect: makes the client, inside the worker's loop; by default one without credentials.
        retry: the pauses between attempts while the robot does not answer; they never end by themselves.
        refused: the pauses between attempts with a login that the robot refuses.

    Raises:
        UserError: the target is not an address.
    """

    def __init__(
        self,
        target: str,
        on_news: Callable[[], None],
        connect: Connect | None = None,
        retry: Backoff = _RETRY,
        refused: Backoff = _REFUSED,
    ) -> None:
        self.target = parse_target(target)
        first = MonitorState(Link(phase=Phase.CONNECTING, since_s=time.monotonic()))
        self._newest = Newest(first, on_news)
        self._connect = connect or connecting()
        self._retry, self._refused = retry, refused
        self._thread = threading.Thread(target=self._run, name="gateway-worker", daemon=True)
        self._loop = asyncio.new_event_loop()
        self._closing = asyncio.Event()
        self._conversation: Conversation | None = None

    def start(self) -> None:
        """Begins to talk."""
        self._thread.start()

    def newest(self) -> MonitorState:
        """The newest state, frozen."""
        return self._newest.get()

    def switch(self, wish: Wish) -> None:
        """Asks the robot for a preview, or for none. While an earlier wish is under way nothing happens.

        The state has the request already when this returns.
        """
        if self._newest.begin_request(wish):
            self._order(Conversation.pass_on_wish)

    def retry_now(self) -> None:
        """Ends the pause before the next attempt."""
        self._order(Conversation.retry_now)

    def close(self, within_s: float = 1.0) -> bool:
        """Hangs up, in the middle of whatever is under way. Whether the thread ended in time."""
        self._soon(self._closing.set)
        if self._thread.ident is None:  # never started
            self._loop.close()
            return True
        self._thread.join(within_s)
        return not self._thread.is_alive()

    def _order(self, give: Callable[[Conversation], None]) -> None:
        def act() -> None:
            if self._conversation:
                give(self._conversation)

        self._soon(act)

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
                remedy = "Close the window and open it again"
                failed = GatewayFailed(f"the monitor itself failed: {error!r}", remedy)
                self._newest.set_link(replace(self.newest().link, phase=Phase.LOST, trouble=failed))
                raise

    async def _work(self) -> None:
        async with self._connect(self.target) as robot:
            feed = PollingFeed(robot, EVERY_S)
            said = Conversation(robot, feed, self._newest, self._retry, self._refused)
            self._conversation = said
            if self.newest().request:
                said.pass_on_wish()
            async with asyncio.TaskGroup() as tasks:
                running = [tasks.create_task(work) for work in (said.follow(), said.serve(), said.listen())]
                tasks.create_task(self._end(running))

    async def _end(self, running: list[asyncio.Task[None]]) -> None:
        await self._closing.wait()
        for task in running:
            task.cancel()
