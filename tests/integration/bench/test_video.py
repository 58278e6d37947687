"""The harness of the video benchmarks, with short windows: it must measure; figures are not judged here."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from bench.video import camera_switching, latency, product, switching
from bench.video.camera import Camera, camera

pytestmark = pytest.mark.gst


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Camera]:
    with camera(tmp_path_factory.mktemp("camera")) as running:
        yield running


@pytest.fixture(scope="module")
def robot(source: Camera, tmp_path_factory: pytest.TempPathFactory) -> Iterator[product.Robot]:
    with product.robot(tmp_path_factory.mktemp("robot"), source, latency.LATENCY_MS) as running:
        yield running


@pytest.mark.parametrize("ours", [False, True])
def test_a_cell_of_the_latency(source: Camera, robot: product.Robot, ours: bool) -> None:
    found = latency.measure(latency.Cell(ours, ours), source, robot, settle_s=0.5, watch_s=1.0)
    # Less than the SRT latency is impossible: the stamp or a clock would be wrong.
    assert 0 < found.median_ms <= found.p99_ms
    assert 0 < found.delivered_percent <= 100


def test_a_round_of_switches(robot: product.Robot) -> None:
    # LOW_BW has 15 frames per second, so the longest gap is no shorter than 67 ms, less some jitter.
    assert switching.round_ms(robot, settle_s=0.3, apart_s=0.6) > 50


def test_a_round_of_cameras(source: Camera, tmp_path: Path) -> None:
    cameras = camera_switching.cameras_of(source)
    with product.robot(tmp_path, None, latency.LATENCY_MS, settings={"cameras": cameras}) as robot:
        longest_ms = camera_switching.camera_round_ms(robot, settle_s=0.3, apart_s=0.6)
        assert robot.client.status().preview.wanted_camera == "front"
    # At 30 frames per second no gap is shorter than 33 ms.
    assert longest_ms > 30
