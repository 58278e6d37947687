"""What the supervisor and its parts need of pipelines, of cameras and of the video tap."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from preview.pipeline.events import AccessUnit
from preview.pipeline.plan import Plan
from preview.pipeline.sources import SourcePlan
from preview.state.values import Measurement, Profile, StreamState


class Pipeline(Protocol):
    """One pipeline; `preview.pipeline.runner.Runner` is the real one."""

    @property
    def plan(self) -> Plan:
        """What it is made of."""

    @property
    def stream(self) -> StreamState:
        """Parameters of the stream being served."""

    @property
    def measurement(self) -> Measurement | None:
        """Newest statistics; None before the first window."""

    async def start(self) -> None:
        """Starts it. Failures are reported as events, also after this has returned."""

    async def switch(self, profile: Profile) -> None:
        """Switches to another profile; viewers stay connected."""

    @property
    def live_camera(self) -> str | None:
        """Camera whose frames are served; None while it has failed and another one is being started."""

    @property
    def starting_camera(self) -> str | None:
        """Camera that is being started beside the live one; None if none is."""

    def show(self, source: SourcePlan | None) -> None:
        """Starts another camera beside the live one, instead of any that is being started; None: none.

        With its first frame it becomes the live one; viewers stay connected. Reported as an event.
        With no live camera and none to be started, the pipeline fails with the fault of the last live one.
        """

    async def listen(self, passphrase: str | None) -> None:
        """Replaces the listener by one with another passphrase, None: by none; the encoder goes on.

        Raises:
            HungError: the old one hangs.
        """

    def record(self, take: Callable[[AccessUnit], None] | None) -> None:
        """Hands each access unit to a recording from now on; None: to none."""

    def request_key_frame(self, newest_pts: int | None) -> bool:
        """Requests a key frame for a viewer that lost a picture; see `KeyframeGate.request_after_loss`."""

    def take_picture_age(self, age_ms: int) -> None:
        """Takes the age of the oldest picture that a viewer shows, for the adaptive bit rate."""

    async def stop(self) -> asyncio.Task[bool]:
        """Stops listener and source, and returns the teardown of the encoder; False when that hangs.

        Raises:
            HungError: the listener or the source hangs.
        """

    async def write_graph(self, path: Path) -> None:
        """Writes its graph, for finding the cause of a fault."""


class PlanCamera(Protocol):
    """Plans cameras; `preview.camera_planner.CameraPlanner.plan` is the real one."""

    async def __call__(self, camera: str) -> SourcePlan:
        """Returns the first elements for a camera of the configuration.

        Raises:
            UserError: it can't be used.
        """


class Recording(Protocol):
    """What the video tap wants of the pipelines; both are called on the loop."""

    def take(self, unit: AccessUnit) -> None:
        """Takes an access unit."""

    def interrupted(self) -> None:
        """The pipeline ends; what follows is another one's."""
