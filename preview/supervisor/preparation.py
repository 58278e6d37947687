"""What a pipeline needs before it can be built: an encoder that works, and the plan of a camera.

Either takes its time, and is given up as soon as a request makes it needless.
"""

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

from preview.encoders.selection import Selection
from preview.pipeline.sources import SourcePlan
from preview.supervisor.ports import PlanCamera

_T = TypeVar("_T")


class Preparation:
    """Prepares one pipeline at a time, on the event loop.

    Args:
        encoders: tries encoders.
        plan_camera: plans cameras.
    """

    def __init__(self, encoders: Selection, plan_camera: PlanCamera) -> None:
        self._encoders = encoders
        self._plan_camera = plan_camera
        self._task: asyncio.Task[Any] | None = None
        self._camera: str | None = None
        """The camera that is being planned; None while none is."""

    async def find_encoder(self) -> bool:
        """Runs trials until an encoder works that has not failed; False when none does, or when given up."""
        return bool(await self._unless_given_up(self._encoders.probe(), "trials until one succeeds"))

    async def plan(self, camera: str) -> SourcePlan | None:
        """Plans a camera; None when that was given up.

        Raises:
            UserError: it can't be used.
        """
        self._camera = camera
        try:
            return await self._unless_given_up(self._plan_camera(camera), f"plan of camera {camera}")
        finally:
            self._camera = None

    def give_up(self) -> None:
        """Gives up what is being prepared."""
        if self._task:
            self._task.cancel()

    def give_up_other_than(self, camera: str) -> None:
        """Gives up the plan of any other camera."""
        if self._camera not in (None, camera):
            self.give_up()

    async def _unless_given_up(self, work: Coroutine[Any, Any, _T], name: str) -> _T | None:
        task = self._task = asyncio.create_task(work, name=name)
        try:
            await asyncio.wait({task})
            return None if task.cancelled() else task.result()
        finally:
            task.cancel()
            self._task = None
