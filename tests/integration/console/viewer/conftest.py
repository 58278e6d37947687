"""A robot with video, and a viewer's session that follows it."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from console.viewer.robot_video import RobotVideo
from console.viewer.session import VideoSession
from tests.support.patient import be_patient
from tests.support.video_ground import VideoGround, video_ground


@pytest.fixture(autouse=True)
def patient(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Calls of a viewer's worker that a stall does not end."""
    be_patient(request, monkeypatch)


@pytest.fixture
def ground(tmp_path: Path) -> Iterator[VideoGround]:
    """Small frames; the preview is off at first."""
    with video_ground(tmp_path) as ground:
        yield ground
        # A process that a test has stopped could not end in good order.
        ground.preview.process.send_signal(signal.SIGCONT)


@contextmanager
def following(target: str, **options: Any) -> Iterator[VideoSession]:
    """A session that follows the gateway's status. A recording stays open."""
    robot = RobotVideo(target, **options)
    robot.start()
    try:
        yield robot.session
    finally:
        # How soon they close has tests of its own.
        assert robot.worker.close(10)
        assert robot.session.close(10)


@pytest.fixture
def session(ground: VideoGround) -> Iterator[VideoSession]:
    """Follows the robot."""
    with following(ground.target) as session:
        yield session
