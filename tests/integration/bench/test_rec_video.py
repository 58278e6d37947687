"""The harness of the benchmarks of recorded video, with short windows: figures are not judged here."""

from collections.abc import Iterator

import pytest

from bench.rec import video
from bench.ros_domain import ros_domain

pytestmark = [pytest.mark.ros, pytest.mark.gst]

WINDOW_S = 3.0
"""Longer than a camera or a viewer stands still with the machine: a window without frames is no figure."""


@pytest.fixture(scope="module")
def ground(tmp_path_factory: pytest.TempPathFactory) -> Iterator[video.Ground]:
    with ros_domain(), video.video_ground(tmp_path_factory.mktemp("video")) as running:
        yield running


def test_a_round_of_stamps(ground: video.Ground) -> None:
    # A second besides as long a pause: the benchmark wants 30 frames at least.
    assert max(video.stamp_errors_ms(ground, 4.0)) < 5000


def test_a_round_of_the_tap(ground: video.Ground) -> None:
    with ground.robot.preview():
        assert video.ms_per_frame(ground, WINDOW_S, recording=False) > 0
        assert video.ms_per_frame(ground, WINDOW_S, recording=True) > 0
