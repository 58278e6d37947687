"""Unary calls with deadlines and retries."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol, TypeVar

from console.client.clock import Clock, Offset
from console.client.errors import Unreachable
from console.client.mapping.methods import (
    GET_SYSTEM_STATUS,
    NO_FIELDS,
    PING,
    SET_PREVIEW_MODE,
    DesiredPreview,
    Method,
    preview_request,
)
from console.client.options import ClientOptions
from console.client.results import CameraState, PreviewChange, PreviewProfile, PreviewState, PreviewStatus

ResultT = TypeVar("ResultT")

# An attempt gets at least this long, so that the last one is not sent just to fail.
_SHORTEST_ATTEMPT_S = 0.05


class UnaryTransport(Protocol):
    """What unary calls need of a transport."""

    async def call(self, method: Method[ResultT], request: bytes, timeout_s: float) -> ResultT:
        """Returns the result of one attempt, or raises a `GatewayError`."""

    async def sleep(self, seconds: float) -> None:
        """Sleeps, or raises `Cancelled` when the client is closed."""


class UnaryCalls:
    """The unary calls of one client.

    Args:
        transport: Carries out single attempts.
        options: Deadlines and backoff.
        clock: Monotonic seconds.
    """

    def __init__(
        self, transport: UnaryTransport, options: ClientOptions, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._transport = transport
        self._options = options
        self._clock = clock
        self.retries = 0
        """Attempts beyond the first, of all calls together."""

    async def read(self, method: Method[ResultT]) -> ResultT:
        """Returns the answer of a method without parameters, within `answer_within_s`."""
        return await self.call(method, NO_FIELDS, self._options.answer_within_s)

    async def call(self, method: Method[ResultT], request: bytes, within_s: float) -> ResultT:
        """Returns the answer of a call, retried while the gateway is unreachable and time is left.

        Args:
            method: Retried only if it is idempotent.
            request: Its request.
            within_s: Deadline of all attempts together.

        Raises:
            GatewayError: The error of the last attempt.
        """
        started = self._clock()
        backoff = self._options.backoff.start()
        while True:
            left_s = within_s - (self._clock() - started)
            try:
                return await self._transport.call(method, request, max(left_s, _SHORTEST_ATTEMPT_S))
            except Unreachable:
                pause_s = backoff.next_s()
                elapsed_s = self._clock() - started + pause_s
                if not method.idempotent or elapsed_s > min(self._options.backoff.give_up_after_s, within_s):
                    raise
            await self._transport.sleep(pause_s)
            self.retries += 1

    async def ping(self, clock: Clock) -> Offset:
        """Returns the offset of the robot's clock, and improves `clock` with the measurement."""
        sent_s = self._clock()
        robot_time = await self.read(PING)
        received_s = self._clock()
        clock.note(sent_s, robot_time, received_s)
        offset = clock.offset(received_s)
        assert offset is not None, "it has a reading now"  # noqa: S101  # just noted
        return offset

    async def set_preview(self, request: DesiredPreview, settle_within_s: float) -> PreviewChange:
        """Sends a preview request, then polls the status until it is fulfilled, failed or time is up."""
        change = await self.call(SET_PREVIEW_MODE, preview_request(request), self._options.preview_within_s)
        until = self._clock() + settle_within_s
        while change.accepted and not _settled(change.preview, request) and self._clock() < until:
            await self._transport.sleep(self._options.settle_poll_s)
            status = await self.read(GET_SYSTEM_STATUS)
            change = replace(change, preview=status.preview)
        return change


def _settled(preview: PreviewStatus, request: DesiredPreview) -> bool:
    if not request.enabled:
        return preview.state is PreviewState.DISABLED
    if preview.state is PreviewState.RUNNING:
        camera = preview.camera(request.camera)
        if camera and camera.state not in (CameraState.LIVE, CameraState.FAILED):
            return False
        return request.profile in (PreviewProfile.UNKNOWN, preview.profile)
    return preview.state is PreviewState.FAULTED
