"""Talks to the gateway in a thread of its own, so that a window never waits for a network."""

import asyncio
import threading
import time
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager, suppress
from dataclasses import replace
from functools import partial
from typing import Final, TypeAlias

from common.tasks import first_to_end
from console.client import (
    Backoff,
    ClientOptions,
    Credentials,
    DesiredPreview,
    GatewayFailed,
    Offset,
    PictureReport,
    parse_target,
)
from console.monitor.conversation import Conversation, RetryBackoff, RobotSession
from console.monitor.credential_refresh import LoadCredentials, RefreshingClient
from console.monitor.driver import Driver
from console.monitor.link import Link, LinkState
from console.monitor.monitor_state import LatestState, MonitorState, PreviewRequest
from console.monitor.recordings import Pictures, Recordings
from console.monitor.viewer_feedback import ViewerFeedback

# One attempt is short here: the conversation retries by itself, and reports each failure.
_OPTIONS: Final = ClientOptions(answer_within_s=1.5, backoff=Backoff(give_up_after_s=0.3))

_CALLS_END_WITHIN_S: Final = 0.5

Connect: TypeAlias = Callable[[str], AbstractAsyncContextManager[RobotSession]]


def connecting(load: LoadCredentials | None = None) -> Connect:
    """Returns a factory of clients with the stored credentials; by default without any.

    Raises:
        UserError: the stored credentials can't be used.
    """
    load = load or Credentials
    credentials = load()
    return lambda target: RefreshingClient(target, _OPTIONS, load, credentials)


class Worker:
    """Follows one robot until closed. Thread-safe; only `close` waits.

    Args:
        target: HOST:PORT.
        on_change: called after each change of `latest()`, in the worker's thread; must only hand over.
        connect: makes the client, inside the worker's loop; by default one without credentials.
        retry: the pauses between attempts.
        picture: returns the report on the picture that is shown; None while there is none to report.
        captured: returns when the picture that is shown was captured, in ns of the robot's monotonic clock;
            None without one.
        pictures: makes pictures of recordings' key frames; None for none.

    Attributes:
        driver: drives, and stops the robot.
        recordings: lists, changes and copies recordings.

    Raises:
        UserError: the target is not an address.
    """

    def __init__(
        self,
        target: str,
        on_change: Callable[[], None],
        connect: Connect | None = None,
        retry: RetryBackoff | None = None,
        *,
        picture: Callable[[], PictureReport | None] = lambda: None,
        captured: Callable[[], int | None] = lambda: None,
        pictures: Pictures | None = None,
    ) -> None:
        self.target = parse_target(target)
        first = MonitorState(Link(state=LinkState.CONNECTING, since_s=time.monotonic()))
        self._latest = LatestState(first, on_change)
        self._connect = connect or connecting()
        self._thread = threading.Thread(target=self._run, name="gateway-worker", daemon=True)
        self._loop = asyncio.new_event_loop()
        self._closing = asyncio.Event()
        self._feedback = ViewerFeedback(picture)
        self._conversation = Conversation(self._latest, retry or RetryBackoff(), self._feedback)
        self.driver = Driver(self._call_soon, on_change, captured)
        self.recordings = Recordings(self._call_soon, on_change, lambda: self._connect(self.target), pictures)

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def latest(self) -> MonitorState:
        """Returns the latest state, frozen."""
        return self._latest.get()

    def switch(self, desired: DesiredPreview) -> None:
        """Requests a state of the preview; does nothing while an earlier request is pending.

        The state has the request already when this returns.
        """

        def begin(state: MonitorState) -> MonitorState:
            pending = state.request is not None and state.request.pending
            return state if pending else replace(state, request=PreviewRequest(desired))

        if self._latest.change(begin):
            self._call_soon(self._conversation.send_request)

    def clock_offset(self) -> Offset | None:
        """Returns the offset of the robot's monotonic clock; None before the first ping."""
        clock = self.latest().clock
        return clock.offset(time.monotonic()) if clock else None

    def takes_requests(self) -> bool:
        """Returns whether a request for a key frame has a prospect: the robot answers, and serves them."""
        return self._feedback.takes_requests and self.latest().link.state is LinkState.CONNECTED

    def request_key_frame(self, newest_pts: int | None) -> bool:
        """Requests a key frame, for a picture that lost packets have torn.

        Returns:
            Whether it is requested.
        """
        if not self.takes_requests():
            return False
        self._call_soon(partial(self._feedback.request_key_frame, newest_pts))
        return True

    def retry_now(self) -> None:
        """Ends the pause before the next attempt."""
        self._call_soon(self._conversation.retry_now)

    def close(self, timeout_s: float = 1.0) -> bool:
        """Disconnects, cancelling pending calls. Returns whether the thread ended in time."""
        self._call_soon(self._closing.set)
        if self._thread.ident is None:  # never started
            self._loop.close()
            return True
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _call_soon(self, act: Callable[[], object]) -> None:
        # A closed loop takes no more calls, and has nothing left to do.
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(act)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            try:
                runner.run(self._converse())
            except Exception as error:
                # A defect of our own must not look like a robot that stands still. stderr has the traceback.
                remedy = "Close the window and open it again"
                failed = GatewayFailed(f"the monitor itself failed: {error!r}", remedy)
                link = replace(self.latest().link, state=LinkState.LOST, error=failed)
                self._latest.update(lambda state: replace(state, link=link))
                raise

    async def _converse(self) -> None:
        async with self._connect(self.target) as robot:
            await first_to_end(
                self._conversation.run(robot),
                self.driver.run(robot),
                self.recordings.run(robot),
                self._closing.wait(),
            )
        # gRPC's own tasks end when its cancelled calls have. Its queue of completions is the process's: what
        # came for this loop after its end would be an error in another worker's.
        if left := asyncio.all_tasks() - {asyncio.current_task()}:
            await asyncio.wait(left, timeout=_CALLS_END_WITHIN_S)
