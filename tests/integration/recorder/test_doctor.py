"""`robot-recorder doctor` and the room that the recorder itself has."""

import json
from itertools import islice
from pathlib import Path

import pytest

from common.findings import Verdict
from recorder.config import MIB
from recorder.doctor.examination import examine
from tests.support.recorder_in_process import running_recorder


def room_mib(config: Path) -> int:
    """What the doctor says of the room, which comes before it looks for the program and the graph."""
    what = next(each.what for each in examine(config) if each.check == "disk.room")
    return int(what.removesuffix(" MiB").rpartition(" ")[2])


def bundles(directory: Path, folders: list[Path]) -> list[tuple[Verdict, str]]:
    """What the doctor says of folders of experiments, before it looks for the program and the graph."""
    config = directory / "recorder.yaml"
    settings = {"root": str(directory / "root"), "run_bundles": [str(each) for each in folders]}
    config.write_text(json.dumps(settings), encoding="utf-8")  # JSON is YAML
    found = islice((each for each in examine(config) if each.check == "run_bundles"), len(folders))
    return [(each.verdict, each.what) for each in found]


def test_a_folder_of_experiments_that_can_not_be_read_is_wrong(tmp_path: Path) -> None:
    there, gone = tmp_path / "there", tmp_path / "gone"
    there.mkdir()
    assert bundles(tmp_path, [there, gone]) == [
        (Verdict.GOOD, f"{there} can be read"),
        (Verdict.WRONG, f"{gone} can't be read: No such file or directory"),
    ]


def test_a_folder_of_experiments_that_the_unit_hides_can_not_be_read_by_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: the doctor, which runs outside the unit, said that it can be read."""
    home, elsewhere = tmp_path / "home", tmp_path / "elsewhere"
    (home / "runs").mkdir(parents=True)
    elsewhere.mkdir()
    (elsewhere / "link").symlink_to(home / "runs")
    monkeypatch.setattr("recorder.doctor.examination._HIDDEN", (home,))
    folders = [home / "runs", elsewhere / "link", elsewhere]
    readable = [(Verdict.GOOD, f"{each} can be read") for each in folders]
    assert bundles(tmp_path, folders) == readable
    monkeypatch.setenv("ROBOT_GATEWAY_START", "sudo systemctl restart")
    hidden = f"can be read, but robot-recorder.service sees nothing below {home}"
    noted = [(Verdict.NOTE, f"{each} {hidden}") for each in folders[:2]]
    assert bundles(tmp_path, folders) == [*noted, readable[2]]


async def test_a_ring_outside_the_root_counts_as_in_the_recorder(tmp_path: Path) -> None:
    ring = tmp_path / "ring"
    ring.mkdir()
    (ring / "000000.mcap.damaged").write_bytes(bytes(8 * MIB))
    apart = {"preset": "all", "directory": str(ring)}
    room = {"quota_bytes": 100 * MIB, "min_free_bytes": 0}
    async with running_recorder(tmp_path / "root", room=room, ring=apart) as running:
        there = running.status_reader.room.bytes
        config = tmp_path / "recorder.yaml"
        presets = {"all": {"topics": ["*"]}}
        settings = {"root": str(tmp_path / "root"), "room": room, "presets": presets, "ring": apart}
        config.write_text(json.dumps(settings), encoding="utf-8")  # JSON is YAML
        assert there < 92 * MIB
        # The ring's first file may have begun between the two.
        assert 0 <= there // MIB - room_mib(config) <= 1
