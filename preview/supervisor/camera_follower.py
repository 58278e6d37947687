"""Brings the running pipeline to the camera that is to be live, as state/cameras.py decides."""

import asyncio
import logging
from collections.abc import Callable, Mapping

from common.errors import UserError
from common.timer import Timer
from preview.config import PreviewSettings
from preview.pipeline.events import Blame, Fault
from preview.state.cameras import Camera, Cameras
from preview.supervisor.ports import Pipeline, PlanCamera

_log = logging.getLogger(__name__)


class CameraFollower:
    """Starts a better camera than the live one beside it, and tries failed ones again when their time comes.

    Without a running pipeline it only remembers what cameras did. Used on the event loop.

    Args:
        settings: name the cameras and their fallbacks.
        plan_camera: plans a camera before it is started.
        on_failure: called with a camera that can't be used, and why; hands it to `failed`, and returns
            whether the pipeline goes on, with the live camera or another.
    """

    def __init__(
        self, settings: PreviewSettings, plan_camera: PlanCamera, on_failure: Callable[[str, Fault], bool]
    ) -> None:
        self._plan_camera = plan_camera
        self._on_failure = on_failure
        self._cameras = Cameras({name: each.fallback for name, each in settings.named_sources.items()})
        self._pipeline: Pipeline | None = None
        self._planning: asyncio.Task[None] | None = None
        self._planned: str | None = None
        """The camera that is being planned, to be started."""
        self._retry_timer = Timer(self.follow)

    @property
    def names(self) -> tuple[str, ...]:
        """All cameras, in the order of the configuration."""
        return self._cameras.names

    @property
    def wanted(self) -> str:
        """The camera that is to be live."""
        return self._cameras.wanted

    @property
    def first(self) -> str:
        """The camera that a new pipeline is to start with."""
        return self._cameras.next_attempt(None, _now()) or self._cameras.wanted

    @property
    def has_one_to_try(self) -> bool:
        """Whether a new pipeline may be tried at once: some camera does not wait for its retry."""
        return self._cameras.next_attempt(None, _now()) is not None

    @property
    def live_and_starting(self) -> tuple[str | None, str | None]:
        """The camera that is live in the running pipeline, and the one that is being started in it."""
        pipeline = self._pipeline
        return (pipeline.live_camera, self._planned or pipeline.starting_camera) if pipeline else (None, None)

    def listed(self, live: str | None, starting: str | None) -> tuple[Camera, ...]:
        """Returns all cameras; see `Cameras.listed`."""
        return self._cameras.listed(live, starting)

    def attach(self, pipeline: Pipeline) -> None:
        """Follows in this pipeline, which runs, from now on."""
        self._pipeline = pipeline

    def detach(self) -> None:
        """The pipeline runs no longer."""
        self._pipeline = None
        self._retry_timer.cancel()
        self._stop_planning()

    def want(self, name: str) -> None:
        """Takes a request of an operator; see `Cameras.want`."""
        self._cameras.want(name)

    def found(self, problems: Mapping[str, str]) -> None:
        """Takes why cameras can't be used, by name; empty for those that are there."""
        self._cameras.found(problems)
        self.follow()

    def delivers(self, camera: str) -> None:
        """Takes the first frame of a camera."""
        if camera == self._planned:
            # Given up when it could not be stopped any more, and chosen again: it needs no second start.
            self._stop_planning()
        self._cameras.delivers(camera, _now())
        self.follow()

    def failed(self, camera: str, failure: str) -> None:
        """Takes the failure of a camera, while it was live or started."""
        self._cameras.failed(camera, failure, _now())
        self.follow()

    def follow(self, *, new_request: bool = False) -> None:
        """Starts a better camera than the live one, or arranges when to.

        Args:
            new_request: an operator has just chosen: a camera that is being started may be given up.
        """
        self._retry_timer.cancel()
        pipeline = self._pipeline
        if pipeline is None:
            return
        live, starting = self.live_and_starting
        if starting in self._cameras.chain and not new_request:
            return  # What follows is decided when it delivers, or fails.
        camera = self._cameras.next_attempt(live, _now())
        if camera is not None:
            if camera != starting:
                self._start(pipeline, camera)
            return
        if live is None:
            return
        if starting is not None:
            self._stop_planning()
            pipeline.show(None)
        wait_s = self._cameras.wait_s(live, _now())
        if wait_s is not None:
            self._retry_timer.start(wait_s)

    def _start(self, pipeline: Pipeline, camera: str) -> None:
        """Plans a camera, and then starts it; counts as being started from now on.

        The one that is being started in the pipeline is given up, unless the live one is lost: it may then be
        the first to deliver, and the pipeline would end without it.
        """
        self._stop_planning()
        if pipeline.starting_camera == camera:
            return
        if pipeline.starting_camera is not None and pipeline.live_camera is not None:
            pipeline.show(None)
        self._planned = camera
        self._planning = asyncio.create_task(self._show(pipeline, camera), name=f"plan of camera {camera}")

    def _stop_planning(self) -> None:
        self._planned = None
        if self._planning:
            self._planning.cancel()
            self._planning = None

    async def _show(self, pipeline: Pipeline, camera: str) -> None:
        source, failure = None, ""
        try:
            source = await self._plan_camera(camera)
        except UserError as error:
            failure = str(error)
        self._planning = self._planned = None
        if source:
            _log.info("camera %s -> %s", pipeline.live_camera or "(failed)", camera)
            pipeline.show(source)
        elif not self._on_failure(camera, Fault(Blame.SOURCE, failure)):
            pipeline.show(None)


def _now() -> float:
    return asyncio.get_running_loop().time()
