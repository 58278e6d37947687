"""`robotctl monitor` and `robotctl view`: build a window, run it, and close everything behind it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from console.monitor.credential_refresh import LoadCredentials
from console.receiver.delivery import DeliveryChoice
from console.receiver.recording import Recording
from console.viewer.robot_video import RobotVideo
from console.viewer.summary import FrameCounter, ViewSummary
from console.window.application import application
from console.window.handover import ThreadHandover
from console.window.monitor_window import MonitorWindow
from console.window.video_view import VideoView
from console.window.view_window import ViewWindow

_CLOSE_TIMEOUT_S = 0.8
"""For each of the two background threads: a program ends within 2 s."""


def run_monitor(target: str, load: LoadCredentials | None = None) -> None:
    """Shows the monitor window until it is closed.

    Args:
        target: the robot's gateway.
        load: reads the stored credentials.

    Raises:
        UserError: the target is not an address, the credentials can't be used, or there is no display.
    """
    with application("Robot monitor") as app, monitor(target, load):
        app.exec()


def run_view(
    target: str,
    record: Path | None,
    load: LoadCredentials | None = None,
    delivery: DeliveryChoice = DeliveryChoice.AUTO,
) -> tuple[ViewSummary, Recording | None]:
    """Shows the video until its window is closed; returns the summary of the run, and the closed recording.

    Args:
        target: the robot's gateway.
        record: a new file for the encoded stream. It is not made where there is no display.
        load: reads the stored credentials.
        delivery: how packets are delivered.

    Raises:
        UserError: as `run_monitor`, or the file can't be written.
    """
    counter = FrameCounter()
    with application("Robot view") as app:
        recording = Recording(record) if record else None
        with viewing(target, recording, counter, load, delivery) as window:
            app.exec()
    session = window.robot.session
    return counter.summary(session.redials, recording, session.delivery()), recording


@contextmanager
def monitor(target: str, load: LoadCredentials | None = None) -> Iterator[MonitorWindow]:
    """Opens the monitor window with its background threads; closes them at the end of the block."""
    changes = ThreadHandover()
    robot = RobotVideo(target, load, on_change=changes.post)
    window = MonitorWindow(robot.worker, changes, VideoView(robot.session, robot.detections))
    with _open(window, robot):
        yield window


@contextmanager
def viewing(
    target: str,
    recording: Recording | None,
    counter: FrameCounter,
    load: LoadCredentials | None = None,
    delivery: DeliveryChoice = DeliveryChoice.AUTO,
) -> Iterator[ViewWindow]:
    """Opens the window of the video with its background threads; closes them at the end of the block."""
    robot = RobotVideo(target, load, recording=recording, delivery=delivery)
    robot.session.add_frame_listener(counter.count)
    window = ViewWindow(robot, VideoView(robot.session, robot.detections))
    with _open(window, robot):
        yield window


@contextmanager
def _open(window: MonitorWindow | ViewWindow, robot: RobotVideo) -> Iterator[None]:
    try:
        robot.start()
        window.show()
        yield
    finally:
        window.close()
        # The shortcuts refer to the window, and it holds the last frame: only Qt can free it.
        window.deleteLater()
        robot.close(_CLOSE_TIMEOUT_S)
