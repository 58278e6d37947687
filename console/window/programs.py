"""`robotctl monitor` and `robotctl view`: build a window, run it, and close everything behind it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QEvent
from PySide6.QtWidgets import QWidget

from common.errors import UserError
from console.gamepad.reader import GamepadReader
from console.monitor.credential_refresh import LoadCredentials
from console.monitor.history import STEP_S
from console.presentation.own_stream import OwnStream
from console.presentation.picture_age import PictureAge
from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle
from console.receiver.delivery import DeliveryChoice
from console.receiver.recording import Recording
from console.robots.roster import RobotChoice, Roster
from console.viewer.formatting import delivery_text
from console.viewer.picture_meter import PictureMeter
from console.viewer.robot_video import RobotVideo
from console.viewer.session import VideoSession
from console.viewer.summary import FrameCounter, ViewSummary
from console.window.application import application
from console.window.drive_hands import Pad
from console.window.handover import ThreadHandover
from console.window.monitor_window import MonitorWindow
from console.window.practice_band import PracticeBand
from console.window.video_view import VideoView
from console.window.view_window import ViewWindow

_CLOSE_TIMEOUT_S = 0.8
"""For each of the two background threads: a program ends within 2 s."""


def run_monitor(
    target: str,
    load: LoadCredentials | None = None,
    roster: Roster | None = None,
    login_of: Callable[[RobotChoice], LoadCredentials | None] = lambda _: None,
) -> None:
    """Shows the monitor window until it is closed; opens another one for each robot that is switched to.

    Args:
        target: the robot's gateway.
        load: reads the stored credentials.
        roster: lists the robots to switch to; by default the known ones.
        login_of: returns what reads the stored credentials of another robot.

    Raises:
        UserError: the target is not an address, the credentials can't be used, or there is no display.
    """
    notice: Note | None = None
    with application("Robot monitor") as app, reading_gamepad() as pad:
        while True:
            with monitor(target, load, roster, pad) as window:
                if notice:
                    window.toasts.show_passing(notice)
                app.exec()
                chosen, notice = window.next_robot, None
            if chosen is None:
                return
            other = login_of(chosen)
            try:
                if other:
                    other()
            except UserError as error:
                # The window of the present robot opens again, and says why there is no other one.
                notice = Note(str(error), SeverityStyle.BAD)
                continue
            target, load = chosen.target, other


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
    session, meter = window.robot.session, window.robot.meter
    return counter.summary(session.redials, recording, session.delivery(), meter.summary()), recording


@contextmanager
def reading_gamepad() -> Iterator[GamepadReader]:
    """Reads the gamepad while the block lasts; without SDL there is none, and the reader says why."""
    reader = GamepadReader()
    reader.start()
    try:
        yield reader
    finally:
        reader.close()


@contextmanager
def monitor(
    target: str,
    load: LoadCredentials | None = None,
    roster: Roster | None = None,
    pad: Pad | None = None,
) -> Iterator[MonitorWindow]:
    """Opens the monitor window with its background threads; closes them at the end of the block."""
    changes = ThreadHandover()
    with cockpit(RobotVideo(target, load, on_change=changes.post), changes, roster, pad) as window:
        yield window


@contextmanager
def cockpit(
    robot: RobotVideo,
    changes: ThreadHandover,
    roster: Roster | None = None,
    pad: Pad | None = None,
    band: PracticeBand | None = None,
) -> Iterator[MonitorWindow]:
    """Opens the monitor window of a robot; closes it with its background threads at the end of the block.

    Args:
        robot: is shown.
        changes: signals changes of its status.
        roster: lists the robots to switch to; by default the known ones.
        pad: a gamepad; None without one.
        band: says that there is no robot; None where there is one.
    """
    video = VideoView(robot.session, robot.detections, robot.meter)
    window = MonitorWindow(robot.worker, changes, video, roster, pad, band=band)
    # The bar has the age; the card would cover the trail.
    video.show_age(False)
    window.read_picture_age = partial(_age_of, robot.meter)
    window.read_worst_age_ms = partial(robot.meter.worst_ms, STEP_S)
    window.read_stream = partial(_stream_of, robot.session)
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
    window = ViewWindow(robot, VideoView(robot.session, robot.detections, robot.meter))
    with _open(window, robot):
        yield window


def _age_of(meter: PictureMeter) -> PictureAge | None:
    now = meter.reading()
    if now.age_ms is None:
        return None
    return PictureAge(now.age_ms, now.error_ms, now.cause.value if now.cause else "")


def _stream_of(session: VideoSession) -> OwnStream | None:
    delivery = session.delivery()
    if delivery is None:
        return None
    return OwnStream(delivery_text(delivery), delivery.loss_percent, bool(delivery.reason))


@contextmanager
def _open(window: MonitorWindow | ViewWindow, robot: RobotVideo) -> Iterator[None]:
    try:
        robot.start()
        window.show()
        yield
    finally:
        window.close()
        robot.close(_CLOSE_TIMEOUT_S)
        _delete(window)


def _delete(window: QWidget) -> None:
    """Deletes a window at once, in this thread, with the hand-overs that it owns.

    Python's garbage collector frees a QObject without a parent in whichever thread it happens to run, while
    Qt may be delivering an event to it: that ends the process.
    """
    for handover in window.findChildren(ThreadHandover):
        # A thread that did not end in time must not post to what is deleted next.
        handover.close()
    window.deleteLater()
    QCoreApplication.sendPostedEvents(window, QEvent.Type.DeferredDelete)
