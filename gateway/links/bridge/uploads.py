"""Uploads as operators and the hub request them: queued at the bridge, and known to the recorder."""

import time
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from typing import Final

from gateway.links.bridge.calls import BridgeCalls
from gateway.links.bridge.copies import Copies
from gateway.status.cloud import CopyReport, RecordingCopy, RecordingCopyState

MOST_ANSWERS: Final = 256
ANSWERED_S: Final = 600.0
"""As long as RecordingService promises that a repeated request changes nothing."""


class Uploads:
    """Passes requests on, each of them once.

    Args:
        calls: to the bridge.
        copies: has the recorder know of it; None where the robot is not set up for recording.
        clock: monotonic seconds.
    """

    def __init__(
        self, calls: BridgeCalls, copies: Copies | None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._calls = calls
        self._copies = copies
        self._clock = clock
        self._answers: OrderedDict[tuple[str, str], tuple[CopyReport, float]] = OrderedDict()
        """By method and request ID, with the instant of the first one."""

    async def queue(
        self, request_id: str, recording_id: str, caller: str, remaining_s: float | None
    ) -> CopyReport:
        """Queues a recording to be copied; returns which, and where its copy stands.

        Args:
            request_id: repeated, it gets the first answer, which is of the recording of then.
            recording_id: which recording.
            caller: for people.
            remaining_s: until the caller's deadline; None without one.

        Raises:
            DomainError: the bridge refuses, or does not answer.
        """

        async def call() -> CopyReport:
            copy = await self._calls.upload(recording_id, caller, remaining_s)
            self._note(recording_id, copy)
            return CopyReport(recording_id, copy)

        return await self._once(("queue", request_id), call)

    async def cancel(
        self, request_id: str, recording_id: str, caller: str, remaining_s: float | None
    ) -> CopyReport:
        """Takes a recording from the queue; returns which, and where its copy stood. As `queue`."""

        async def call() -> CopyReport:
            copy = await self._calls.cancel(recording_id, caller, remaining_s)
            if copy.state is not RecordingCopyState.VERIFIED:
                self._note(recording_id, RecordingCopy(RecordingCopyState.UNSPECIFIED))
            return CopyReport(recording_id, copy)

        return await self._once(("cancel", request_id), call)

    def _note(self, recording_id: str, copy: RecordingCopy) -> None:
        if self._copies:
            self._copies.note(CopyReport(recording_id, copy))

    async def _once(self, key: tuple[str, str], call: Callable[[], Awaitable[CopyReport]]) -> CopyReport:
        now_s = self._clock()
        while self._answers and now_s - next(iter(self._answers.values()))[1] > ANSWERED_S:
            self._answers.popitem(last=False)
        if key in self._answers:
            return self._answers[key][0]
        answer = await call()
        self._answers[key] = answer, now_s
        if len(self._answers) > MOST_ANSWERS:
            self._answers.popitem(last=False)
        return answer
