"""A robot's status for its video."""

import time
from dataclasses import replace

import pytest

from console.viewer.robot_video import RobotVideo
from tests.support.snapshots import heard


@pytest.mark.parametrize(("silent_s", "known"), [(0.9, True), (1.1, False)])
def test_detections_are_unknown_when_the_robot_falls_silent(
    monkeypatch: pytest.MonkeyPatch, silent_s: float, known: bool
) -> None:
    robot = RobotVideo("robot")
    state = replace(heard(), heard_s=time.monotonic() - silent_s)
    monkeypatch.setattr(robot.worker, "latest", lambda: state)
    assert (robot.detections() is not None) == known


def test_before_the_first_status_there_are_no_detections() -> None:
    assert RobotVideo("robot").detections() is None
