"""`robotctl monitor`: builds the window, runs it, and closes everything behind it."""

from collections.abc import Iterator
from contextlib import contextmanager

from console.monitor.credential_refresh import LoadCredentials
from console.viewer.robot_video import RobotVideo
from console.window.application import application
from console.window.handover import ThreadHandover
from console.window.monitor_window import MonitorWindow
from console.window.video_view import VideoView
from console.window.window_settings import WindowSettings

_CLOSE_TIMEOUT_S = 0.8
"""For each of the two background threads: the program ends within 2 s."""


def run_monitor(target: str, load: LoadCredentials | None = None) -> None:
    """Shows the window until it is closed.

    Args:
        target: the robot's gateway.
        load: reads the stored credentials.

    Raises:
        UserError: the target is not an address, the credentials can't be used, or there is no display.
    """
    with application("Robot monitor") as app, monitor(target, load):
        app.exec()


@contextmanager
def monitor(target: str, load: LoadCredentials | None = None) -> Iterator[MonitorWindow]:
    """Opens the window with its background threads; closes them at the end of the block."""
    changes = ThreadHandover()
    robot = RobotVideo(target, load, on_change=changes.post)
    video = VideoView(robot.session, robot)
    window = MonitorWindow(robot.worker, changes, video, WindowSettings())
    try:
        robot.start()
        window.show()
        yield window
    finally:
        window.close()
        # The shortcuts refer to the window, and it holds the last frame: only Qt can free it.
        window.deleteLater()
        robot.close(_CLOSE_TIMEOUT_S)
