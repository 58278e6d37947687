"""Driving by the picture that the window shows: a real preview, gateway and drive program."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from console.client import DrivePhase
from console.monitor.driver import DriverView
from console.viewer.playback import PlaybackState
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.driven_robot import DrivenRobot, driven_robot, drives_undisturbed
from tests.support.qt import keep_screenshot, let_pass, press, until
from tests.support.running_preview import RunningPreview

pytestmark = [pytest.mark.ros, pytest.mark.gst]

ATTEMPTS = 10
"""On a machine that is too busy the robot stops without need."""
WINDOW = (1280, 800)
STALE_MS = 600
LINE_OF_SIGHT_MPS = 0.15
"""Without a picture nothing is faster."""
PROFILE = {"width_px": 1280, "height_px": 720, "fps": 15, "bitrate_kbps": 2000}


@pytest.fixture
def preview(tmp_path: Path) -> Iterator[RunningPreview]:
    """Where the gateway looks for it."""
    directory = tmp_path / "robot"
    directory.mkdir()
    with RunningPreview(directory, {"profiles": {"balanced": PROFILE}}) as preview:
        yield preview


@pytest.fixture
def robot(preview: RunningPreview, ros_domain: int) -> Iterator[DrivenRobot]:  # noqa: ARG001  # in force
    with driven_robot(preview.socket.parent) as robot:
        yield robot


@pytest.mark.timeout(300)
def test_the_robot_moves_while_a_fresh_picture_is_shown(robot: DrivenRobot, preview: RunningPreview) -> None:
    drives_undisturbed(robot, lambda: it_moves_while_a_fresh_picture_is_shown(robot, preview))


def it_moves_while_a_fresh_picture_is_shown(robot: DrivenRobot, preview: RunningPreview) -> None:
    if preview.process.poll() is not None:  # An attempt before this one has killed it.
        preview.start_again()
    with monitor(robot.target) as window:
        window.showNormal()
        window.resize(*WINDOW)
        window.activateWindow()
        until(window.isActiveWindow, "the window is active")
        until(window.preview.switch.isEnabled, "the preview's switch")
        until(lambda: robot.gateway.status().preview.service_reachable, "the preview service", 40)
        if robot.gateway.status().preview.state == states.PREVIEW_DISABLED:
            press(window, Qt.Key.Key_P)
        until(lambda: window.video.playback().state is PlaybackState.LIVE, "the picture", 60)
        press(window, Qt.Key.Key_T)
        it_moves(window, robot)
        state = view(window).state
        assert state
        assert state.picture_age_ms is not None
        assert state.picture_age_ms < STALE_MS
        keep_screenshot(window, "driving", fills_in_s=4.0, at_last=lambda: it_is_seen_to_move(window, robot))
        preview.process.kill()
        preview.process.wait()
        until(lambda: not robot.base.moves, "the base is at rest")
        until(lambda: "INHIBITED" in shown(window) and "picture" in shown(window), "why")
        before = len(robot.base.heard)
        let_pass(0.5)
        assert not any(each.moves for each in robot.base.heard[before:])


def it_moves(window: MonitorWindow, robot: DrivenRobot) -> None:
    """Holds until the base moves; releases first whenever the robot is inhibited, or the hold has lapsed."""
    for _ in range(ATTEMPTS):
        until(lambda: view(window).ready or "STOPPED" in shown(window), "the robot may be driven", 40)
        # A drive program that has lost its worker to a stall is stopped, and stays so.
        assert view(window).ready, shown(window)
        QTest.keyPress(window, Qt.Key.Key_W)
        if until(lambda: moving_or_not(window, robot), "it moves, or the hold has ended") == "moves":
            return
        QTest.keyRelease(window, Qt.Key.Key_W)
    raise AssertionError(f"it does not move: {shown(window)}")


def it_is_seen_to_move(window: MonitorWindow, robot: DrivenRobot) -> None:
    """Holds anew where a machine that is busy with pictures has made the robot stop meanwhile."""
    for _ in range(ATTEMPTS):
        if "DRIVING" in shown(window):
            return
        QTest.keyRelease(window, Qt.Key.Key_W)
        it_moves(window, robot)
        let_pass(0.2)
    raise AssertionError(f"it does not move: {shown(window)}")


def moving_or_not(window: MonitorWindow, robot: DrivenRobot) -> str:
    if robot.base.moves and robot.base.heard[-1].vx_mps > LINE_OF_SIGHT_MPS:
        return "moves"
    state = view(window).state
    at_rest = state is not None and state.phase in (DrivePhase.INHIBITED, DrivePhase.STOPPED)
    return "rests" if at_rest or not window.driving.hands._down else ""


def view(window: MonitorWindow) -> DriverView:
    return window._worker.driver.view()


def shown(window: MonitorWindow) -> str:
    return window.picture.hud.accessibleName()
