"""Faults whose windows overlap make one incident, on a clock that a test sets forward."""

import time
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import pytest

from recorder.recording import ring_recorder, snapshots
from recorder.recording.requests import SnapshotOptions
from recorder.store.manifest import Kind, Manifest, RecordingState
from tests.support.recorder_in_process import Running, Source, numbers, running_recorder

PRE_S: Final = 20
POST_S: Final = 60
NS_PER_S: Final = 1_000_000_000
ERROR: Final = 3


class SetForward:
    """The clocks of the ring, ahead of those of the computer."""

    def __init__(self) -> None:
        self.ahead_s = 0

    def monotonic(self) -> float:
        return time.monotonic() + self.ahead_s

    def monotonic_ns(self) -> int:
        return time.monotonic_ns() + self.ahead_s * NS_PER_S

    def time_ns(self) -> int:
        return time.time_ns() + self.ahead_s * NS_PER_S


@dataclass
class Ground:
    """A recorder with a ring.

    Attributes:
        clock: of its ring.
        sent: what its messages come from.
    """

    running: Running
    clock: SetForward
    sent: Source

    async def fault(self, fault_id: str, message: str = "") -> str:
        return await self.running.operations.report_fault(fault_id, ERROR, message)

    def incident(self, recording_id: str) -> Manifest:
        """The manifest, which has to be on the disk as it is in memory."""
        manifest = self.running.status_reader.get(recording_id)
        folder = self.running.status_reader.folder_of(manifest)
        assert Manifest.model_validate_json((folder / "manifest.json").read_bytes()) == manifest
        return manifest

    async def ended(self) -> None:
        await self.running.until(lambda: not self.running.status_reader.snapshots_pending)


@pytest.fixture
async def ground(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Ground]:
    clock = SetForward()
    for each in (ring_recorder, snapshots):
        monkeypatch.setattr(each, "time", clock)
    incidents = {"pre_s": PRE_S, "post_s": POST_S, "cooldown_s": 600}
    ring = {"preset": "all", "seconds": 600}
    async with running_recorder(tmp_path, ring=ring, incidents=incidents) as running:
        await running.until(lambda: running.status_reader.writes)
        yield Ground(running, clock, Source(running.queue))


async def test_two_faults_whose_windows_overlap_make_one_incident(ground: Ground) -> None:
    ground.sent.send(10)
    made = await ground.fault("vision.silent", "nothing comes")
    first = ground.incident(made)
    assert first.trigger == "vision.silent: nothing comes"
    ground.clock.ahead_s = POST_S - 20
    assert await ground.fault("battery.low", "15 %") == made
    merged = ground.incident(made)
    assert merged.trigger == "vision.silent: nothing comes; battery.low"
    assert first.window_ns
    assert merged.window_ns
    assert merged.window_ns[0] == first.window_ns[0]
    assert merged.window_ns[1] - first.window_ns[1] >= (POST_S - 20) * NS_PER_S
    assert [each.id for each in ground.running.status_reader.recordings] == [made]


async def test_it_lasts_for_the_second_fault_as_long_as_for_the_first(ground: Ground) -> None:
    ground.sent.send(10)
    made = await ground.fault("vision.silent")
    ground.clock.ahead_s = POST_S - 20
    await ground.fault("battery.low")
    # The first one's end has passed, and the second one's has not.
    ground.clock.ahead_s = POST_S + 20
    ground.sent.send(10)
    # An operation takes what there is to do; a snapshot of its own ends at once, and the incident goes on.
    await ground.running.operations.snapshot("1", SnapshotOptions(pre_s=1, post_s=0), "ann")
    await ground.running.until(lambda: ground.running.status_reader.snapshots_pending == 1)
    assert ground.incident(made).state is RecordingState.RECORDING
    ground.clock.ahead_s = 2 * POST_S
    await ground.ended()
    incident = ground.incident(made)
    assert (incident.state, incident.kind) == (RecordingState.COMPLETE, Kind.INCIDENT)
    assert numbers(ground.running.status_reader, incident) == list(range(1, 21))


async def test_a_fault_that_was_merged_makes_none_of_its_own_until_it_has_cooled_down(ground: Ground) -> None:
    made = await ground.fault("vision.silent")
    assert await ground.fault("battery.low") == made
    assert await ground.fault("battery.low") == made
    ground.clock.ahead_s = POST_S + 1
    await ground.ended()
    assert ground.incident(made).trigger == "vision.silent; battery.low", "once"
    assert await ground.fault("battery.low") == made
    other = await ground.fault("drive.lost")
    assert other not in ("", made)
    assert ground.incident(other).trigger == "drive.lost"


async def test_a_snapshot_that_is_being_made_is_no_incident(ground: Ground) -> None:
    asked = await ground.running.operations.snapshot("1", SnapshotOptions(post_s=POST_S), "ann")
    made = await ground.fault("vision.silent")
    assert asked.recording
    assert made not in ("", asked.recording.id)
    assert ground.running.status_reader.get(asked.recording.id).trigger == "ann"


async def test_very_many_faults_make_one_trigger_of_bounded_length(ground: Ground) -> None:
    made = await ground.fault("fault.0")
    for number in range(1, 200):
        assert await ground.fault(f"fault.{number}") == made
    trigger = ground.incident(made).trigger
    assert trigger.startswith("fault.0; fault.1; fault.2;")
    assert len(trigger) == 1000
