"""A tap per test, in a ROS domain of its own."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.running_tap import RunningTap


@pytest.fixture
def tap(ros_domain: int, tmp_path: Path) -> Iterator[RunningTap]:  # noqa: ARG001  # for its effect
    """A camera tap."""
    with RunningTap(tmp_path) as running:
        yield running
