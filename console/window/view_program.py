"""`robotctl view`: builds the window, runs it, and closes everything behind it."""

from collections.abc import Iterator
from contextlib import contextmanager

from console.monitor.credential_refresh import LoadCredentials
from console.receiver.recording import Recording
from console.viewer.robot_video import RobotVideo
from console.viewer.summary import FrameCounter, ViewSummary
from console.window.application import application
from console.window.video_view import VideoView
from console.window.view_window import ViewWindow

_CLOSE_TIMEOUT_S = 0.8
"""For each of the two background threads."""


def run_view(target: str, recording: Recording | None, load: LoadCredentials | None = None) -> ViewSummary:
    """Shows the window until it is closed; returns the summary of the run.

    Raises:
        UserError: the target is not an address, the credentials can't be used, or there is no display.
    """
    counter = FrameCounter()
    with application("Robot view") as app, viewing(target, recording, counter, load) as window:
        app.exec()
    return counter.summary(window.robot.session.redials, recording)


@contextmanager
def viewing(
    target: str, recording: Recording | None, counter: FrameCounter, load: LoadCredentials | None = None
) -> Iterator[ViewWindow]:
    """Opens the window with its background threads; closes them at the end of the block."""
    robot = RobotVideo(target, load, recording=recording)
    robot.session.add_frame_listener(counter.count)
    window = ViewWindow(robot, VideoView(robot.session, robot))
    try:
        robot.start()
        window.show()
        yield window
    finally:
        window.close()
        # The shortcuts refer to the window, and it holds the last frame: only Qt can free it.
        window.deleteLater()
        robot.close(_CLOSE_TIMEOUT_S)
