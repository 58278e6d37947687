"""The harness of the export benchmarks, with a small recording: figures are not judged here."""

import asyncio
from collections.abc import Iterator

import pytest

from bench.export import resuming, status, throughput
from bench.export.copying import copied
from bench.export.ground import ExportingRobot, exporting_robot

pytestmark = pytest.mark.ros

SIZE = 8 * 1024 * 1024


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ExportingRobot]:
    with exporting_robot(tmp_path_factory.mktemp("export"), SIZE) as running:
        yield running


def test_the_recording_is_as_large_as_requested_and_copied_whole(robot: ExportingRobot) -> None:
    assert robot.recording.size > SIZE
    assert robot.recording.size == sum(each.stat().st_size for each in robot.paths)
    assert copied(robot.target, robot.streams()).size > robot.recording.size


def test_a_round_of_throughput(robot: ExportingRobot) -> None:
    with throughput.bare_stream(robot.paths) as target:
        ours, bare = throughput.one_round(robot, target)
    assert ours > 0
    assert bare > 0


def test_a_cut_connection_loses_nothing_and_little_comes_twice(robot: ExportingRobot) -> None:
    whole = asyncio.run(resuming.passed_bytes(robot, None))
    assert whole > robot.recording.size
    cut = asyncio.run(resuming.passed_bytes(robot, SIZE // 2))
    assert cut < 2 * whole, "it began anew"


def test_a_turn_of_the_status(robot: ExportingRobot) -> None:
    alone, beside = status.one_turn(robot, 1024 * 1024, copiers=1)
    assert alone > 0
    assert beside > 0
