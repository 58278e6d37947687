"""Snapshots of a ring at 10 MB/s: how long after their last second they are complete, and their disk."""

import hashlib
import time
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rec.ground import PRESET, delete, talker
from bench.rows import FEWEST_ROUNDS, Row
from omniseer.gateway.v1 import recording_pb2 as pb
from tests.support.running_recorder import RecorderProgram, recorder_program
from tests.support.waiting import wait_until

ROUNDS: Final = FEWEST_ROUNDS
RATE_MB_S: Final = 10
PRE_S: Final = 15
POST_S: Final = 3
RING: Final = {"preset": "all", "seconds": 30}
_WITHIN_S: Final = 60.0
_BLOCK_BYTES: Final = 512
"""Of `st_blocks` (stat(2))."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One round.

    Attributes:
        late_ms: from its last second until it was complete.
        used_bytes: of the disk, by ring and snapshot together.
        data_bytes: of their segments, each content once.
    """

    late_ms: float
    used_bytes: int
    data_bytes: int


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    rounds = []
    with recorder_program(workdir, presets=PRESET, ring=RING) as recorder, talker(RATE_MB_S):
        wait_until(
            lambda: recorder.state.status.ring_s >= PRE_S, f"the ring holds {PRE_S} s", _WITHIN_S + PRE_S
        )
        for _ in range(ROUNDS):
            rounds.append(one_snapshot(recorder, PRE_S, POST_S))
            log(f"rec.snapshot: {rounds[-1]}")
    window = f"{PRE_S} s before and {POST_S} s after, at {RATE_MB_S} MB/s"
    found = [
        Row(
            name="rec.snapshot_ms",
            what=f"last second of a snapshot ({window}) until the snapshot is complete",
            unit="ms",
            values=[each.late_ms for each in rounds],
            bar=500,
            judged="worst",
        ),
        Row(
            name="rec.snapshot_disk",
            what=f"disk that ring and snapshot take ({window}), against their data, each content once",
            unit="bytes",
            values=[float(each.used_bytes) for each in rounds],
            references=[float(each.data_bytes) for each in rounds],
            bar=1.02,
        ),
    ]
    return [row for row in found if row.name in wanted]


def one_snapshot(recorder: RecorderProgram, pre_s: int, post_s: int) -> Snapshot:
    """Takes a snapshot, measures it, and deletes it.

    Raises:
        RuntimeError: it is not complete.
    """
    request = pb.TriggerSnapshotRequest(request_id=uuid.uuid4().hex, pre_s=pre_s, post_s=post_s)
    asked_s = time.monotonic()
    recording_id = recorder.call("TriggerSnapshot", request).recording.id
    running = pb.RECORDING_STATE_RECORDING
    made = wait_until(
        lambda: each if (each := recorder.recording(recording_id)).state != running else None,
        "the snapshot ends",
        post_s + _WITHIN_S,
    )
    late_ms = (time.monotonic() - asked_s - post_s) * 1000
    if made.state != pb.RECORDING_STATE_COMPLETE or not made.messages_written:
        raise RuntimeError(f"the snapshot is not complete: {made}")
    used, data = disk(recorder.root / "ring", recorder.root / "recordings" / recording_id)
    delete(recorder, made)
    return Snapshot(late_ms, used, data)


def disk(*folders: Path) -> tuple[int, int]:
    """Returns what folders take on the disk, links counted once, and the size of their final segments.

    Segments with the same content count once: a copy takes the disk twice for one content.
    """
    blocks: dict[int, int] = {}
    contents: dict[bytes, int] = {}
    hashed: dict[int, bytes] = {}
    for path in (each for folder in folders for each in folder.rglob("*")):
        try:
            if path.suffix == ".part" or not path.is_file():
                continue
            stat = path.stat()
            if path.suffix == ".mcap" and stat.st_ino not in hashed:
                with path.open("rb") as file:
                    hashed[stat.st_ino] = hashlib.file_digest(file, "sha256").digest()
                contents[hashed[stat.st_ino]] = stat.st_size
        except FileNotFoundError:
            continue  # the ring drops its oldest segment meanwhile
        blocks[stat.st_ino] = stat.st_blocks * _BLOCK_BYTES
    return sum(blocks.values()), sum(contents.values())
