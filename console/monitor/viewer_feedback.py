"""What a viewer sends to the robot besides watching: requests for key frames, and the age of its picture."""

import asyncio
import time
from collections.abc import Callable
from typing import Final, Protocol

from common.token_bucket import TokenBucket
from console.client import Clock, GatewayError, PictureReport, Unsupported, results

_REPORT_S: Final = 1.0
_BURST: Final = 3
_REQUEST_EVERY_S: Final = 0.34
"""The robot takes three requests at once of one connection, and three a second in the long run. Further
losses meanwhile share the next one."""
_LEAST_ANSWER_S: Final = 0.4
"""Room for one repetition of a lost segment: TCP waits for 200 ms at least (RFC 6298, Linux's minimum)."""
_LONGEST_ANSWER_S: Final = 1.0
_FAILED_FOR_S: Final = 5.0
"""After a request that failed, for whatever reason, a new connection to the stream is the quicker way."""


def answer_within_s(rtt_s: float | None) -> float:
    """Returns how long the answer to a request is waited for, in seconds.

    Meanwhile no picture is shown, so it is not longer than a gateway that works takes at this round trip.

    Args:
        rtt_s: the shortest of the last calls; None if unknown.
    """
    return _LONGEST_ANSWER_S if rtt_s is None else min(_LEAST_ANSWER_S + 2 * rtt_s, _LONGEST_ANSWER_S)


class FeedbackClient(Protocol):
    """What is used here of `console.client.AsyncGatewayClient`."""

    @property
    def clock(self) -> Clock:
        """The estimate of the robot's clock."""

    async def request_key_frame(self, newest_pts: int | None = ...) -> results.KeyFrameAnswer:
        """Requests a key frame."""

    async def report_picture(self, report: PictureReport) -> None:
        """Reports the picture that is shown."""


class ViewerFeedback:
    """Sends requests and reports while it runs. Belongs to the loop that runs it.

    Both are best effort: one that fails is not repeated, because the next one says more, and the conversation
    notices by itself that a robot does not answer. After a request that failed, none is taken for a while. A
    robot that is too old for them is not asked again on this connection.

    Args:
        picture: returns the report on the picture that is shown; None while there is none to report.
    """

    def __init__(self, picture: Callable[[], PictureReport | None]) -> None:
        self._picture = picture
        self._requested = asyncio.Event()
        self._newest_pts: int | None = None
        self._known = False
        """Whether there is a connection, to a robot that knows requests for key frames."""
        self._failed_until_s = 0.0

    @property
    def takes_requests(self) -> bool:
        """Whether a request for a key frame has a prospect: it is known, and did not fail just now."""
        return self._known and time.monotonic() >= self._failed_until_s

    def request_key_frame(self, newest_pts: int | None) -> None:
        """Requests a key frame after the newest frame of which anything has arrived."""
        self._newest_pts = newest_pts
        self._requested.set()

    async def run(self, client: FeedbackClient) -> None:
        """Runs until cancelled."""
        self._requested.clear()
        self._known, self._failed_until_s = True, 0.0
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._send_requests(client))
                tasks.create_task(self._send_reports(client))
                # Its end would be taken for that of the connection.
                await asyncio.Event().wait()
        finally:
            self._known = False

    async def _send_requests(self, client: FeedbackClient) -> None:
        bucket = TokenBucket(_BURST, time.monotonic())
        while self._known:
            await self._requested.wait()
            if not _take(bucket):
                # A ms more, so that the token is whole.
                await asyncio.sleep((1 - bucket.tokens) * _REQUEST_EVERY_S + 0.001)
                _take(bucket)
            self._requested.clear()
            await self._send_request(client)

    async def _send_request(self, client: FeedbackClient) -> None:
        try:
            async with asyncio.timeout(answer_within_s(_rtt_s(client))):
                await client.request_key_frame(self._newest_pts)
        except Unsupported:
            self._known = False
        except (GatewayError, TimeoutError):
            self._failed_until_s = time.monotonic() + _FAILED_FOR_S

    async def _send_reports(self, client: FeedbackClient) -> None:
        while True:
            await asyncio.sleep(_REPORT_S)
            if report := self._picture():
                try:
                    await client.report_picture(report)
                except Unsupported:
                    return
                except GatewayError:
                    continue  # The next one says more.


def _take(bucket: TokenBucket) -> bool:
    return bucket.take(time.monotonic(), capacity=_BURST, refill_per_s=1 / _REQUEST_EVERY_S)


def _rtt_s(client: FeedbackClient) -> float | None:
    """Returns the round trip to the gateway; half of it bounds the error of the clock's estimate."""
    offset = client.clock.offset(time.monotonic())
    return 2 * offset.error_s if offset else None
