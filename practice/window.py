"""`robotctl practice`: the cockpit with a practice robot behind it, and a band that says so."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from console.receiver.address import StreamAddress
from console.receiver.frame_queue import FrameQueue
from console.receiver.options import ReceiverOptions
from console.robots.robots_file import RobotsFile
from console.robots.roster import Roster
from console.viewer.decoders import Decoders
from console.viewer.robot_video import RobotVideo
from console.window.application import application
from console.window.drive_hands import Pad
from console.window.handover import ThreadHandover
from console.window.monitor_window import MonitorWindow
from console.window.practice_band import PracticeBand
from console.window.practice_picture import painted
from console.window.programs import cockpit, reading_gamepad
from practice.camera import CameraStream
from practice.network import NETWORKS, Network
from practice.robot import PracticeRobot
from practice.scene import View
from practice.session import PracticeSession

TARGET: Final = "practice.invalid:1"
"""No host has this name (RFC 6761 6.4): even a program that connected to it would reach nothing."""
_NO_ROBOTS: Final = Roster(lambda: RobotsFile(Path()))
"""To switch to: from practice no one gets to a robot."""


@dataclass
class Practice:
    """What the window drives.

    Attributes:
        network: between window and robot; may be changed at any time.
    """

    robot: PracticeRobot
    network: Network = NETWORKS[0]

    def session(self, _target: str) -> PracticeSession:
        """Returns the worker's client."""
        return PracticeSession(self.robot, lambda: self.network)

    def stream(self, _address: StreamAddress, queue: FrameQueue, _options: ReceiverOptions) -> CameraStream:
        """Returns a connection to the camera."""
        return CameraStream(queue, self._look, self._captured, lambda: self.network, painted)

    def choose(self, number: int) -> None:
        """Changes the network."""
        self.network = NETWORKS[number]

    def _look(self) -> View:
        pose = self.robot.pose
        return View(pose.x_m, pose.y_m, pose.heading_rad)

    def _captured(self, captured_ns: int) -> None:
        self.robot.captured_ns = captured_ns


@contextmanager
def practising(pad: Pad | None = None) -> Iterator[tuple[MonitorWindow, Practice]]:
    """Opens the practice window with its background threads; closes them at the end of the block."""
    practice = Practice(PracticeRobot(time.monotonic_ns()))
    changes = ThreadHandover()
    robot = RobotVideo(
        TARGET,
        connect=practice.session,
        receive=practice.stream,
        decoders=Decoders(lambda _codec: None),
        on_change=changes.post,
    )
    band = PracticeBand([(each.title, each.lesson) for each in NETWORKS])
    band.chosen.connect(practice.choose)
    with cockpit(robot, changes, _NO_ROBOTS, pad, band) as window:
        yield window, practice


def run_practice() -> None:
    """Shows the practice window until it is closed.

    Raises:
        UserError: there is no display.
    """
    with application("Robot practice") as app, reading_gamepad() as pad, practising(pad):
        app.exec()
