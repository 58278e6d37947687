"""The camera whose frames a pipeline serves, and the one that is being started to take its place.

camera_switch.py has the steps from the one to the other.
"""

import asyncio
import logging
from collections.abc import Callable, Coroutine
from dataclasses import replace
from typing import Any

from common.errors import UserError
from common.tasks import end
from preview.pipeline import faults
from preview.pipeline.camera_switch import CameraFailedError, Candidate, dispose
from preview.pipeline.encoder_driver import EncoderDriver
from preview.pipeline.events import Blame, Fault, HungError, PipelineEvents
from preview.pipeline.file_loop import FileLoop
from preview.pipeline.running import Running
from preview.pipeline.source_end import SourceEnd
from preview.pipeline.sources import SourcePlan

_log = logging.getLogger(__name__)


class LiveCamera:
    """Watches the end of the live camera, and lets another one take its place.

    Args:
        running: the pipeline; its source and plan change with the camera.
        driver: no camera takes over while it calls.
        events: receives what becomes of the cameras.
        on_end: called when the live camera has ended.
        fail: called with the fault that ends the pipeline.
        read_bus: takes the errors that were posted by now.
    """

    def __init__(
        self,
        running: Running,
        driver: EncoderDriver,
        events: PipelineEvents,
        *,
        on_end: Callable[[], None],
        fail: Callable[[Fault], None],
        read_bus: Callable[[], None],
    ) -> None:
        self._running = running
        self._driver = driver
        self._events = events
        self._on_end = on_end
        self._fail = fail
        self._read_bus = read_bus
        self._stop_s = running.plan.settings.timeouts.stop_s
        self._task: asyncio.Task[None] | None = None
        """Starts the newest camera."""
        self._candidate: Candidate | None = None
        """A camera that is being started beside the live one."""
        self._took_over: Candidate | None = None
        """The live one, unless it is the pipeline's first."""
        self._lost: Fault | None = None
        """Of the live camera, while the pipeline goes on because another one is being started."""
        self._showing: SourcePlan | None = None
        """What is being started, or about to be."""
        self._left_behind: list[str] = []
        """Labels of cameras that hung when they were stopped."""
        self._file_loop: FileLoop | None = None
        self._attach()

    @property
    def name(self) -> str | None:
        """Name of the camera whose frames are served; None while it has failed."""
        return None if self._lost else self._running.plan.source.camera

    @property
    def starting(self) -> str | None:
        """Name of the camera that is being started to become the live one; None if none is."""
        return self._showing.camera if self._showing else None

    @property
    def held_back(self) -> int:
        """Frames that the live camera has delivered before their time had come; see `Candidate`."""
        return self._took_over.held_back if self._took_over else 0

    def show(self, source: SourcePlan | None) -> None:
        """Starts another camera, which becomes the live one with its first frame; reported as an event.

        Args:
            source: the newest one counts: a camera that is being started is stopped first. None: it is
                stopped, and the live one stays; where there is none, the pipeline fails.
        """
        self._showing = source
        self._task = asyncio.create_task(self._show(source, self._task), name="camera")
        self._task.add_done_callback(lambda task: self._shown(task, source))
        if source is None and self._lost:
            self._fail(self._lost)

    def survives(self, fault: Fault) -> bool:
        """Whether the pipeline goes on without its live camera, which has this fault."""
        if self._lost is None:
            self._lost = fault
            return self._events.camera_failed(self._running.plan.source.camera, fault)
        return True

    def take_error(self, culprit: Any, reason: str) -> bool:
        """Takes an error of another camera than the live one; returns whether it is of one."""
        candidate = self._candidate
        if candidate and faults.is_within(culprit, candidate.source):
            candidate.fail(f"failed: {reason}")
            return True
        return self._is_old(culprit)

    async def close(self) -> None:
        """Stops what is being started."""
        if self._task:
            await end([self._task])

    def release(self) -> None:
        """Watches nothing any more, and drops every reference to the pipeline; after `close`."""
        self.detach()
        # A cancelled task keeps its frames, and with them the candidate that was being started.
        self._task = self._took_over = None

    def detach(self) -> None:
        """Watches the live camera no longer."""
        self._source_end.detach()
        if self._file_loop:
            self._file_loop.detach()
            self._file_loop = None

    def check_left_behind(self) -> None:
        """Raises HungError if a camera hung when it was stopped."""
        if self._left_behind:
            raise HungError(f"{self._left_behind[0]} hung when it was stopped")

    async def _show(self, source: SourcePlan | None, before: "asyncio.Task[None] | None") -> None:
        if before and not before.done():
            before.cancel()
            await _finished(before)
        if source is None:
            return
        plan = replace(self._running.plan, source=source)
        try:
            candidate = self._candidate = Candidate(self._running.parts, plan)
            try:
                await candidate.deliver(plan.settings.timeouts.start_s, self._read_bus)
                await _uninterrupted(self._take_over(candidate, source))
            finally:
                self._candidate = None
                if self._running.parts.source is not candidate.source:
                    await _uninterrupted(self._leave(candidate.stop(self._stop_s), source))
        except UserError as error:
            self._show_failed(source, Fault(Blame.SOURCE, str(error)))
        except CameraFailedError as error:
            self._show_failed(source, faults.of(Blame.SOURCE, str(error), plan))

    async def _take_over(self, candidate: Candidate, source: SourcePlan) -> None:
        """Makes a camera that delivers the live one, and stops the old one."""
        running = self._running
        async with self._driver.lock:
            if running.has_ended:
                return
            old, before = running.parts.source, running.plan.source
            try:
                await candidate.take_over(old, replace(running.plan, source=source))
            except TimeoutError:
                self._fail(faults.of(Blame.OTHER, "hung when the camera was changed", running.plan))
                return
            self.detach()
            running.parts = replace(running.parts, source=candidate.source)
            running.plan = replace(running.plan, source=source)
            self._took_over, self._candidate, self._lost = candidate, None, None
            self._attach()
        self._driver.request_key_frame()
        if self._showing is source:
            self._showing = None
        if not running.has_ended:
            self._events.camera_shown(source.camera)
        await self._leave(dispose(running.parts.pipeline, old, self._stop_s), before)

    def _shown(self, task: "asyncio.Task[None]", source: SourcePlan | None) -> None:
        """Takes a defect for a failure of the camera: otherwise it would count as being started for ever."""
        error = None if task.cancelled() else task.exception()
        if error is None or source is None:
            return
        _log.error("%s could not be started", source.label, exc_info=error)
        plan = replace(self._running.plan, source=source)
        self._show_failed(source, faults.of(Blame.SOURCE, f"failed: {error}", plan))

    def _show_failed(self, source: SourcePlan, fault: Fault) -> None:
        if self._running.has_ended:
            return
        if self._showing is source:
            self._showing = None
        goes_on = self._events.camera_failed(source.camera, fault)
        if self._lost and not goes_on:
            self._fail(self._lost)

    async def _leave(self, stopping: Coroutine[Any, Any, None], source: SourcePlan) -> None:
        """Waits until a camera has stopped; one that hangs is left behind until the pipeline is stopped."""
        try:
            await stopping
        except TimeoutError:
            _log.error("%s hung when it was stopped", source.label)
            self._left_behind.append(source.label)

    def _attach(self) -> None:
        """Watches the end of the live camera."""
        source = self._running.parts.source
        self._source_end = SourceEnd(source, self._on_end)
        if self._running.plan.source.loops:
            self._file_loop = FileLoop(self._running.parts.pipeline, source, self._on_end)

    def _is_old(self, culprit: Any) -> bool:
        """Whether an element is of a camera that is being stopped; its errors are of no interest any more."""
        parts, top = self._running.parts, culprit
        while top is not None and top is not parts.pipeline and top.get_parent() is not parts.pipeline:
            top = top.get_parent()  # None once it has been removed.
        return top not in (parts.pipeline, parts.source, parts.body)


async def _uninterrupted(work: Coroutine[Any, Any, None]) -> None:
    """Awaits what must not be left half done, to its end even if it is cancelled meanwhile."""
    task = asyncio.create_task(work)
    await _finished(task)
    task.result()


async def _finished(task: "asyncio.Task[None]") -> None:
    """Waits for the end of a task, even if the wait is cancelled: the task takes a bounded time."""
    try:
        await asyncio.wait({task})
    except asyncio.CancelledError:
        await asyncio.wait({task})
        raise
