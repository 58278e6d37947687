"""The harness of the recording benchmarks, with short windows: figures are not judged here."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from bench.rec import cpu, killing, losing, recovering, snapshots
from bench.rec.ground import PRESET, talker
from bench.rec.reading import gaps, missing
from bench.ros_domain import ros_domain
from tests.support.running_recorder import RecorderProgram, recorder_program

pytestmark = pytest.mark.ros

MIB = 1024 * 1024


@pytest.fixture(scope="module")
def recorder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RecorderProgram]:
    ring = {"preset": "all", "seconds": 10}
    folder = tmp_path_factory.mktemp("rec")
    with ros_domain(), recorder_program(folder, presets=PRESET, ring=ring) as running:
        yield running


def test_a_round_of_losing_counts_what_the_publisher_has_counted(recorder: RecorderProgram) -> None:
    with talker(10) as publisher:
        found = losing.one_round(recorder, publisher, 2.0)
    assert found.published > 1000
    assert 0 <= found.untaken <= found.lost <= found.published
    assert found.gaps >= found.lost - found.untaken
    assert found.miscounted >= 0


def test_missing_messages_are_counted() -> None:
    found = {"/a": {1, 2, 4, 5}, "/b": {7}}
    assert missing(found, {"/a": 1, "/b": 6, "/c": 0}, {"/a": 5, "/b": 8, "/c": 2}) == 1 + 1 + 2


def test_gaps_are_between_messages() -> None:
    assert gaps({"/a": {2, 3, 5, 9}, "/b": {7}, "/c": set()}) == 1 + 3


def test_windows_of_cpu(recorder: RecorderProgram, tmp_path: Path) -> None:
    with talker(cpu.RATE_MB_S):
        assert cpu.ours(recorder, 1.0).us_per_message > 0
        assert cpu.reference(tmp_path, 1.0).us_per_message > 0


def test_a_round_of_snapshots(recorder: RecorderProgram) -> None:
    with talker(snapshots.RATE_MB_S):
        found = snapshots.one_snapshot(recorder, 2, 1)
    assert found.late_ms > 0
    assert found.used_bytes > found.data_bytes / 2 > 0


def test_a_copy_takes_the_disk_twice_and_a_link_does_not(tmp_path: Path) -> None:
    ring, kept = tmp_path / "ring", tmp_path / "kept"
    for folder in (ring, kept):
        folder.mkdir()
    (ring / "0.mcap").write_bytes(bytes(range(256)) * 1024)
    (kept / "0.mcap").hardlink_to(ring / "0.mcap")
    used, data = snapshots.disk(ring, kept)
    assert used <= 1.05 * data
    (kept / "1.mcap").write_bytes((ring / "0.mcap").read_bytes())
    assert snapshots.disk(ring, kept) == (2 * used, data)


def test_a_round_of_killing(tmp_path: Path) -> None:
    with ros_domain(), talker(killing.RATE_MB_S):
        assert killing.one_kill(tmp_path, 0.2) > 0


def test_a_round_of_recovering(tmp_path: Path) -> None:
    left = recovering.unfinished(tmp_path, 2 * MIB)
    assert recovering.recovered_mib_s(left, tmp_path) > 0
    assert left.exists(), "only a copy is recovered"
