"""The harness of the driving benchmarks, with short windows: it must measure; figures are not judged here."""

from collections.abc import Iterator

import pytest

from bench.drive import cpu, losses, picture, revoking, stopping, thawing
from bench.drive.ground import Ground, driven_ground, driver
from tests.support.tcp_link import needs_tun

# Timed: on a machine that is busy with other tests, late commands would end the motion.
pytestmark = [pytest.mark.ros, pytest.mark.timed]


@pytest.fixture(scope="module")
def ground(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ground]:
    with driven_ground(tmp_path_factory.mktemp("drive")) as running:
        yield running


@pytest.mark.parametrize("fault", ["gateway_killed", "client_frozen", "lanes_silent", "worker_killed"])
def test_a_round_of_a_fault(ground: Ground, fault: str) -> None:
    assert 0 < stopping.stopped_ms(ground, stopping.FAULTS[fault]) < 1000


@needs_tun
@pytest.mark.parametrize("fault", ["cable_cut", "downlink"])
def test_a_round_of_a_fault_of_a_link(ground: Ground, fault: str) -> None:
    assert 0 < stopping.stopped_ms(ground, stopping.FAULTS[fault]) < 1000


def test_a_round_of_stops_under_siege(ground: Ground) -> None:
    assert stopping.viewer_ms(ground, stops=5, watchers=10) > 0


@pytest.mark.gst
def test_a_round_of_the_picture(ground: Ground) -> None:
    assert 0 < picture.stopped_ms(ground, "camera") < 2000


def test_a_round_of_a_revocation(ground: Ground) -> None:
    assert 0 < revoking.moved_ms(ground) < 3000


def test_a_round_of_freezing(ground: Ground) -> None:
    with ground.robot() as robot:
        # A frozen program is no sooner noticed than a command expires, less the time that it was on its way.
        assert 100 < thawing.moved_ms(robot, times=2) < 1000


def test_a_window_of_cpu(ground: Ground) -> None:
    with ground.robot() as robot, driver(robot.target):
        assert 0 < cpu.cpu_percent(ground, 0.5) < 200


@needs_tun
def test_a_round_over_a_link_that_loses_packets(ground: Ground) -> None:
    found = losses.drive(ground, loss=0.03, lanes=1, seconds=2.0, seed=1)
    assert found.p99_ms > 10, "one way takes 10 ms"
