"""What is recorded, as it comes: the topics of the ROS 2 graph, and the preview's video."""

import asyncio
import logging
import time
from contextlib import ExitStack
from types import TracebackType
from typing import Final, Self

from recorder.config import RecorderSettings
from recorder.intake.intake import Intake, intake
from recorder.intake.latched import LatchedCache
from recorder.video.tap import Tap
from recorder.writing.queue import SampleQueue

_log = logging.getLogger(__name__)

_CATCH_UP_S: Final = 0.5
_CATCH_UP_POLL_S: Final = 0.01


class RobotSources:
    """Fills the queue with what is wanted, for as long as its block lasts.

    Args:
        settings: of the program.
        queue: what it fills.

    Attributes:
        latched: for the writer.
    """

    def __init__(self, settings: RecorderSettings, queue: SampleQueue) -> None:
        self._settings = settings
        self._queue = queue
        self._stack = ExitStack()
        self._intake: Intake | None = None
        self._tap: Tap | None = None
        self._tapping: asyncio.Task[None] | None = None
        self._ending: set[asyncio.Task[None]] = set()
        self.latched = LatchedCache()

    async def __aenter__(self) -> Self:
        """Joins the graph.

        Raises:
            UserError: ROS 2 can't be used.
        """
        self._intake = self._stack.enter_context(intake(self._settings.presets, self._queue.put))
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leaves the graph."""
        self._end_tap()
        await asyncio.gather(*self._ending, return_exceptions=True)
        await asyncio.to_thread(self._stack.close)

    @property
    def problem(self) -> str:
        """What keeps something wanted from being recorded, for people; empty if nothing does."""
        problems = self._intake.problems if self._intake else {}
        if problems:
            return next(iter(problems.values()))
        without = self._tap.problem if self._tap else ""
        return f"no video from the preview: {without}" if without else ""

    def want(self, presets: frozenset[str], *, video: bool) -> None:
        """Takes the topics of these presets, and the video, from now on; everything else no longer."""
        if self._intake:
            self._intake.want(presets)
        if video and self._tapping is None and self._settings.video.socket:
            self._tap = Tap(self._settings.video.socket, self._queue.put, frozenset(self._settings.presets))
            self._tapping = asyncio.create_task(self._tap.run(), name="video tap")
        elif not video:
            self._end_tap()

    async def caught_up(self) -> None:
        """Returns when all that has come or was lost by now is in the queue, or after half a second."""
        if self._tap:
            self._tap.catch_up()
        if self._intake is None:
            return
        asked_s = time.monotonic()
        ticket = self._intake.catch_up()
        while self._intake.caught_up < ticket:
            if time.monotonic() - asked_s > _CATCH_UP_S:
                _log.warning("ROS 2 has not been read for %g s", _CATCH_UP_S)
                return
            await asyncio.sleep(_CATCH_UP_POLL_S)

    def _end_tap(self) -> None:
        self._tap = None
        if self._tapping:
            self._tapping.cancel()
            self._ending.add(self._tapping)
            self._tapping.add_done_callback(self._ending.discard)
            self._tapping = None
