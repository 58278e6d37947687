"""A robot with video, and a viewer's session that follows it."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from console.monitor.video import pass_on
from console.monitor.worker import Worker
from console.viewer.session import VideoSession
from tests.support.video_ground import VideoGround, video_ground


@pytest.fixture
def ground(tmp_path: Path) -> Iterator[VideoGround]:
    """Small pictures; the preview is off at first."""
    with video_ground(tmp_path) as ground:
        yield ground
        # A process that a test has stopped could not end in good order.
        ground.preview.process.send_signal(signal.SIGCONT)


@contextmanager
def following(target: str, **options: Any) -> Iterator[VideoSession]:
    """A session that is told what the gateway says."""
    session = VideoSession(**options)
    worker = Worker(target, lambda: pass_on(worker.newest(), session))
    session.start()
    worker.start()
    try:
        yield session
    finally:
        assert worker.close()
        assert session.close()


@pytest.fixture
def session(ground: VideoGround) -> Iterator[VideoSession]:
    """Follows the robot."""
    with following(ground.target) as session:
        yield session
