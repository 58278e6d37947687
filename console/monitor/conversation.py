"""Conversation with one robot: three tasks that outlive every connection."""

import asyncio
import time
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, suppress
from dataclasses import replace
from typing import Final, NoReturn, Protocol

from common.backoff import Backoff
from common.tasks import first_to_end
from console.client import (
    Clock,
    DesiredPreview,
    GatewayError,
    InvalidRequest,
    NotAllowed,
    NotTrusted,
    Offset,
    Outage,
    Unsupported,
    results,
)
from console.monitor.driver import DriveClient
from console.monitor.event_log import EventLine, line_of
from console.monitor.link import Link, LinkState
from console.monitor.monitor_state import LatestState
from console.monitor.recordings import RecordingClient
from console.monitor.snapshot_events import SnapshotEvents
from console.monitor.viewer_feedback import ViewerFeedback

STATUS_INTERVAL_S: Final = 0.1
"""Least time between two statuses: boxes over the video are at most so much older than they need be."""
_PING_S: Final = 0.5
"""Period of measuring the round trip. An answer also shows that the latest status still holds."""
_CREDENTIAL_POLL_S: Final = 0.5
"""Period, while the robot does not answer, of checking for other stored credentials."""
_FIRST_PAUSE_S: Final = 0.5
_LONGEST_PAUSE_S: Final = 2.0
_LONGEST_RETRY_AFTER_S: Final = 60.0
"""No gateway locks a caller out for longer; a longer retry-after does not come from one."""
_MS_PER_S: Final = 1000


class RobotClient(DriveClient, RecordingClient, Protocol):
    """The calls of `console.client.AsyncGatewayClient` that the monitor makes."""

    def watch_status(
        self, min_interval_s: float = ..., *, include_detections: bool = ...
    ) -> AsyncGenerator[results.WatchedStatus | Outage]:
        """Streams the status with its detections."""

    @property
    def clock(self) -> Clock:
        """The estimate of the robot's clock."""

    async def ping(self) -> Offset:
        """Makes the lightest call there is. Improves `clock`."""

    async def overlay(self) -> results.OverlaySnapshot:
        """Returns status, detections and the newest events."""

    def events(
        self, after: results.EventPosition | None = ...
    ) -> AsyncIterator[results.Event | results.EventGap | results.CaughtUp | Outage]:
        """Streams events, each one once."""

    async def set_preview(
        self, desired: DesiredPreview, *, settle_within_s: float = ...
    ) -> results.PreviewChange:
        """Turns the preview on or off, or changes its profile."""

    async def request_key_frame(self, newest_pts: int | None = ...) -> results.KeyFrameAnswer:
        """Requests a key frame."""

    async def report_picture(self, report: results.PictureReport) -> None:
        """Reports the picture that is shown."""


class RobotSession(Protocol):
    """A client and its credentials; `console.monitor.credential_refresh.RefreshingClient` is one."""

    @property
    def client(self) -> RobotClient:
        """The client with the credentials in use."""

    async def refresh(self) -> bool:
        """Takes over other stored credentials. Returns whether there were any."""


class RetryBackoff:
    """Pauses between attempts: one backoff for a silent robot, a slower one for rejected credentials.

    Presenting rejected credentials often looks like guessing, and locks out their owner.

    Args:
        silent: while the robot does not answer.
        rejected: while the robot rejects the credentials, or can't prove its identity.
    """

    def __init__(self, silent: Backoff | None = None, rejected: Backoff | None = None) -> None:
        self._silent = silent or Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        self._rejected = rejected or Backoff(first_s=5.0, longest_s=60.0)

    def next_s(self, error: GatewayError) -> float:
        """Returns the pause after this error, in seconds; at least the robot's retry-after."""
        backoff = self._rejected if isinstance(error, NotAllowed | NotTrusted) else self._silent
        return max(backoff.next_s(), min(error.retry_after_s or 0.0, _LONGEST_RETRY_AFTER_S))

    def reset(self) -> None:
        """Starts again from the first pauses, after an answer."""
        self._silent.reset()
        self._rejected.reset()


class Conversation:
    """Follows the status, streams events, sends requests. Belongs to the loop that runs it.

    Args:
        latest: takes every change of the state.
        retry: the pauses between attempts; they never end by themselves.
        feedback: what a viewer sends to the robot, while that answers.
    """

    _robot: RobotSession

    def __init__(self, latest: LatestState, retry: RetryBackoff, feedback: ViewerFeedback) -> None:
        self._latest = latest
        self._retry = retry
        self._feedback = feedback
        self._snapshot_events: SnapshotEvents | None = None
        """Finds them while the gateway does not stream them."""
        self._answering = asyncio.Event()
        self._lost = asyncio.Event()
        """The opposite, from the first error on."""
        self._retry_now = asyncio.Event()
        self._requested = asyncio.Event()

    def retry_now(self) -> None:
        """Ends the pause before the next attempt."""
        self._retry_now.set()

    def send_request(self) -> None:
        """Sends the pending request of the state."""
        self._requested.set()

    async def run(self, robot: RobotSession) -> None:
        """Runs until cancelled. Raises only what is a defect of our own."""
        self._robot = robot
        async with asyncio.TaskGroup() as tasks:
            for part in (self._follow_status(), self._stream_events(), self._serve_requests()):
                tasks.create_task(part)

    async def _follow_status(self) -> None:
        """Follows the status; while none comes, retries after a pause."""
        while True:
            try:
                try:
                    await first_to_end(self._watch(), self._measure_round_trip(), self._send_feedback())
                except NotAllowed:
                    # The end of an open stream says less about the login than the refusal of a call.
                    if self._answering.is_set():
                        await self._robot.client.ping()
                    raise
                # Only a gateway that is too old to stream its status with detections gets here.
                await self._poll()
            except GatewayError as error:
                pause_s = self._retry.next_s(error)
                self._on_error(error, pause_s)
                await self._wait_to_retry(pause_s)
                self._latest.update(lambda state: replace(state, link=replace(state.link, next_try_s=None)))

    async def _stream_events(self) -> None:
        """Logs each event once. A gateway that can't stream them lists the newest in its snapshots."""
        position: results.EventPosition | None = None
        listed = SnapshotEvents()
        backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        while True:
            try:
                async for item in self._robot.client.events(position):
                    if not isinstance(item, Outage):
                        position = item.position
                        backoff.reset()
                    if line := line_of(item, time.time()):
                        self._log([line])
            except Unsupported:
                # Until the connection is lost: the gateway that answers then may be a newer one.
                self._snapshot_events = listed
                await self._lost.wait()
                self._snapshot_events = None
                await self._answering.wait()
            except InvalidRequest:
                # A position that this gateway does not take would be refused for ever.
                position = None
                await asyncio.sleep(backoff.next_s())
            except GatewayError:
                # The status task reports why there is no connection, and one retrying task is enough.
                await asyncio.sleep(backoff.next_s())
                await self._answering.wait()

    async def _serve_requests(self) -> None:
        """Sends requests, one at a time; their effect on the preview shows in the next snapshots."""
        while True:
            await self._requested.wait()
            self._requested.clear()
            request = self._latest.get().request
            assert request is not None  # noqa: S101  # set before the event is
            try:
                outcome: results.PreviewChange | GatewayError = await self._robot.client.set_preview(
                    request.desired, settle_within_s=0
                )
            except GatewayError as error:
                outcome = error
            done = replace(request, outcome=outcome, ended_s=time.monotonic())
            self._latest.update(lambda state: state.with_outcome(done))  # noqa: B023 - called at once

    async def _watch(self) -> None:
        """Streams the status. Returns if the gateway is too old to stream it with its detections.

        An outage is an error here: the operator sees when the next attempt is, and need not wait for it.
        """
        asked_s = time.monotonic()
        watched = self._robot.client.watch_status(STATUS_INTERVAL_S, include_detections=True)
        async with aclosing(watched):
            async for item in watched:
                if isinstance(item, Outage):
                    raise item.error
                if item.detections is None:
                    return
                # The first one comes at once: how long it took is an answer's time, like a ping's later.
                answer_ms = self._latest.get().link.answer_ms or (time.monotonic() - asked_s) * _MS_PER_S
                snapshot = results.OverlaySnapshot(status=item.status, detections=item.detections, events=())
                self._on_snapshot(snapshot, answer_ms)

    async def _poll(self) -> NoReturn:
        """Polls the status of an older gateway."""
        while True:
            asked_s = time.monotonic()
            snapshot = await self._robot.client.overlay()
            took_s = time.monotonic() - asked_s
            self._on_snapshot(snapshot, took_s * _MS_PER_S)
            # After a slow answer the next poll follows at once; missed ones are not made up for.
            await asyncio.sleep(max(0.0, STATUS_INTERVAL_S - took_s))

    async def _measure_round_trip(self) -> NoReturn:
        """Pings the gateway while it streams its status."""
        await self._answering.wait()
        client = self._robot.client
        while True:
            asked_s = time.monotonic()
            await client.ping()
            now_s = time.monotonic()
            link = replace(self._latest.get().link, answer_ms=(now_s - asked_s) * _MS_PER_S)
            heard = {"link": link, "heard_s": now_s, "clock": client.clock}
            self._latest.update(lambda state: replace(state, **heard))  # type: ignore[arg-type]  # noqa: B023 - called at once
            await asyncio.sleep(_PING_S)

    async def _send_feedback(self) -> None:
        await self._answering.wait()
        await self._feedback.run(self._robot.client)

    async def _wait_to_retry(self, pause_s: float) -> None:
        """Waits for the end of the pause, the operator's request, or other stored credentials."""
        self._retry_now.clear()
        ends_s = time.monotonic() + pause_s
        while True:
            left_s = max(0.0, min(ends_s - time.monotonic(), _CREDENTIAL_POLL_S))
            with suppress(TimeoutError):
                async with asyncio.timeout(left_s):
                    await self._retry_now.wait()
            if await self._robot.refresh() or self._retry_now.is_set() or time.monotonic() >= ends_s:
                return

    def _on_snapshot(self, snapshot: results.OverlaySnapshot, answer_ms: float) -> None:
        self._answering.set()
        self._lost.clear()
        self._retry.reset()
        now_s, before = time.monotonic(), self._latest.get().link
        since_s = before.since_s if before.state is LinkState.CONNECTED else now_s
        link = Link(state=LinkState.CONNECTED, since_s=since_s, answer_ms=answer_ms)
        self._latest.update(
            lambda state: replace(state, link=link, snapshot=snapshot, received_s=now_s, heard_s=now_s)
        )
        if self._snapshot_events and (lines := self._snapshot_events.new_lines(snapshot)):
            self._log(lines)

    def _on_error(self, error: GatewayError, pause_s: float) -> None:
        self._answering.clear()
        self._lost.set()
        state = self._latest.get()
        before = state.link
        link = Link(
            state=LinkState.LOST,
            since_s=state.heard_s if before.state is LinkState.CONNECTED else before.since_s,
            error=error,
            attempts=before.attempts + 1,
            next_try_s=time.monotonic() + pause_s,
        )
        self._latest.update(lambda state: replace(state, link=link))

    def _log(self, lines: list[EventLine]) -> None:
        self._latest.update(lambda state: replace(state, events=state.events.with_lines(lines)))
