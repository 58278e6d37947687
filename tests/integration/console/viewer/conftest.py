"""A robot with video, and a viewer's session that follows it."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from console.viewer.robot_video import RobotVideo
from console.viewer.session import VideoSession
from tests.support.video_ground import VideoGround, video_ground


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
        assert robot.worker.close()
        assert robot.session.close()


@pytest.fixture
def session(ground: VideoGround) -> Iterator[VideoSession]:
    """Follows the robot."""
    with following(ground.target) as session:
        yield session
