"""`robot-recorder doctor` and the room that the recorder itself has."""

import json
from itertools import islice
from pathlib import Path

from common.findings import Verdict
from recorder.config import MIB
from recorder.doctor.examination import examine
from tests.support.recorder_in_process import running_recorder


def room_mib(config: Path) -> int:
    """What the doctor says of the room, which comes before it looks for the program and the graph."""
    what = next(each.what for each in examine(config) if each.check == "disk.room")
    return int(what.removesuffix(" MiB").rpartition(" ")[2])


def test_a_folder_of_experiments_that_can_not_be_read_is_wrong(tmp_path: Path) -> None:
    there, gone = tmp_path / "there", tmp_path / "gone"
    there.mkdir()
    config = tmp_path / "recorder.yaml"
    settings = {"root": str(tmp_path / "root"), "run_bundles": [str(there), str(gone)]}
    config.write_text(json.dumps(settings), encoding="utf-8")  # JSON is YAML
    # Both come before it looks for the program and the graph.
    found = list(islice((each for each in examine(config) if each.check == "run_bundles"), 2))
    assert [(each.verdict, each.what) for each in found] == [
        (Verdict.GOOD, f"{there} can be read"),
        (Verdict.WRONG, f"{gone} can't be read: No such file or directory"),
    ]


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
