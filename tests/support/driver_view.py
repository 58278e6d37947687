"""The picture that a driver drives by: the project's own viewer, whose screen can freeze."""

from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager

from console.client import AsyncGatewayClient, DriveOptions, PreviewProfile, PreviewState
from console.receiver.frame import Frame, PixelFormat
from console.viewer.robot_video import RobotVideo
from tests.support.driven_robot import DrivenRobot, available
from tests.support.eventually import eventually

_PATIENCE_S = 30.0
_CLOSE_WITHIN_S = 10.0
_YOUNG_MS = 300


class Viewer:
    """The project's viewer, whose screen can freeze.

    Args:
        target: the gateway's address.

    Attributes:
        shown_ns: capture of the newest picture that was ever shown.
    """

    def __init__(self, target: str) -> None:
        self.video = RobotVideo(target, pixels=PixelFormat.I420)
        self.video.session.add_frame_listener(self._show)
        self.frozen = False
        self.shown_ns = 0

    def _show(self, frame: Frame) -> None:
        if not self.frozen:
            self.video.meter.shown(frame)
            self.shown_ns = max(self.shown_ns, frame.capture_ns or 0)


def by_picture(viewer: Viewer) -> DriveOptions:
    """The options of a driver who sees what this viewer shows."""
    return DriveOptions(picture=viewer.video.meter.capture_ns)


@contextmanager
def viewing(target: str) -> Iterator[Viewer]:
    """A viewer that is closed when the block ends."""
    viewer = Viewer(target)
    viewer.video.start()
    try:
        yield viewer
    finally:
        viewer.video.close(_CLOSE_WITHIN_S)


@asynccontextmanager
async def young_picture(
    robot: DrivenRobot, profile: PreviewProfile = PreviewProfile.BALANCED
) -> AsyncIterator[tuple[AsyncGatewayClient, Viewer]]:
    """A client and a viewer that shows the robot's picture; no stop is latched."""
    with viewing(robot.target) as viewer:
        async with available(robot) as client:

            async def runs() -> bool:
                return (await client.status()).preview.state is PreviewState.RUNNING

            async def age_ms() -> float:
                return viewer.video.meter.reading().age_ms or float("inf")

            await client.enable_preview(profile)
            await eventually(runs, bool, "the preview runs", _PATIENCE_S)
            await eventually(age_ms, lambda it: it < _YOUNG_MS, "a young picture", _PATIENCE_S)
            yield client, viewer
