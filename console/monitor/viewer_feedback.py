"""What a viewer sends to the robot besides watching: requests for key frames, and the age of its picture."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, Final, Protocol

from console.client import GatewayError, PictureReport, Unsupported, results

_REPORT_S: Final = 1.0
_LEAST_BETWEEN_REQUESTS_S: Final = 0.34
"""The robot takes three requests a second of one connection. Further losses meanwhile share the next one."""


class FeedbackClient(Protocol):
    """The calls of `console.client.AsyncGatewayClient` that are made here."""

    async def request_key_frame(self, newest_pts: int | None = ...) -> results.KeyFrameAnswer:
        """Requests a key frame."""

    async def report_picture(self, report: PictureReport) -> None:
        """Reports the picture that is shown."""


class ViewerFeedback:
    """Sends requests and reports while it runs. Belongs to the loop that runs it.

    Both are best effort: one that fails is not repeated, because the next one says more, and the conversation
    notices by itself that a robot does not answer. A robot that is too old for them is not asked again on
    this connection.

    Args:
        picture: returns the report on the picture that is shown; None while there is none to report.
    """

    def __init__(self, picture: Callable[[], PictureReport | None]) -> None:
        self._picture = picture
        self._requested = asyncio.Event()
        self._newest_pts: int | None = None
        self.takes_requests = False
        """Whether a request for a key frame reaches a robot that knows it."""

    def request_key_frame(self, newest_pts: int | None) -> None:
        """Requests a key frame after the newest frame of which anything has arrived."""
        self._newest_pts = newest_pts
        self._requested.set()

    async def run(self, client: FeedbackClient) -> None:
        """Runs until cancelled."""
        self._requested.clear()
        self.takes_requests = True
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._send_requests(client))
                tasks.create_task(self._send_reports(client))
                # Its end would be taken for that of the connection.
                await asyncio.Event().wait()
        finally:
            self.takes_requests = False

    async def _send_requests(self, client: FeedbackClient) -> None:
        while self.takes_requests:
            await self._requested.wait()
            self._requested.clear()
            self.takes_requests = await _is_known(client.request_key_frame(self._newest_pts))
            await asyncio.sleep(_LEAST_BETWEEN_REQUESTS_S)

    async def _send_reports(self, client: FeedbackClient) -> None:
        known = True
        while known:
            await asyncio.sleep(_REPORT_S)
            if report := self._picture():
                known = await _is_known(client.report_picture(report))


async def _is_known(call: Coroutine[Any, Any, object]) -> bool:
    """Makes a call; returns whether the robot knows its method."""
    try:
        await call
    except GatewayError as error:
        return not isinstance(error, Unsupported)
    return True
