"""Which recordings each rule queues by itself."""

from dataclasses import replace
from typing import Any

import pytest

from bridge.uploads.queue import Priority, State, Upload
from console.client.results import RecordingCopyState, RecordingKind
from omniseer.gateway.v1 import recording_pb2 as pb
from tests.support.uploading import Robot, Rows, running_uploads

HUB: Any = None


@pytest.mark.parametrize(
    ("rule", "queued"),
    [
        ("none", set()),
        ("incidents", {"incident", "pinned_incident"}),
        ("pinned", {"incident", "pinned_incident", "pinned"}),
        ("all", {"incident", "pinned_incident", "pinned", "plain", "snapshot"}),
    ],
)
async def test_a_rule_queues_what_it_names(rule: str, queued: set[str]) -> None:
    robot = Robot()
    kinds = {
        "incident": (RecordingKind.INCIDENT, False),
        "pinned_incident": (RecordingKind.INCIDENT, True),
        "pinned": (RecordingKind.MANUAL, True),
        "plain": (RecordingKind.MANUAL, False),
        "snapshot": (RecordingKind.SNAPSHOT, False),
    }
    for name, (kind, pinned) in kinds.items():
        known = robot.add(name, {"data.bin": b"x"})
        copy = replace(known.copy, state=RecordingCopyState.UNKNOWN)
        robot.recordings[name] = replace(known, kind=kind, pinned=pinned, copy=copy)
    settings: dict[str, Any] = {"rule": rule, "only_while_charging": True}
    async with running_uploads(robot, HUB, "127.0.0.1:9", (), Rows(), **settings) as running:
        await running.uploads.consider(robot.recordings.values())
        waiting = {each.recording_id: each.priority for each in running.uploads.queue.waiting}
    assert waiting.keys() == queued
    assert Priority.BY_HAND not in waiting.values()


@pytest.mark.parametrize("rule", ["pinned", "all"])
async def test_a_copied_recording_that_the_robot_can_not_read_is_not_queued_again(rule: str) -> None:
    """The defect: its upload failed with "the recording has no files" until the recorder was restarted."""
    robot, rows = Robot(), Rows()
    robot.add("unread", {}, state=pb.RECORDING_STATE_FAULTED, pinned=True)
    robot.add("cut", {"data.bin": b"xy"}, state=pb.RECORDING_STATE_FAULTED, pinned=True)
    for each in robot.recordings:
        rows.rows[each] = Upload(recording_id=each, started_unix_ms=1, state=State.VERIFIED, size=1)
    settings: dict[str, Any] = {"rule": rule, "only_while_charging": True}
    async with running_uploads(robot, HUB, "127.0.0.1:9", (), rows, **settings) as running:
        await running.uploads.consider(robot.recordings.values())
        assert [each.recording_id for each in running.uploads.queue.waiting] == ["cut"]
        assert (await running.uploads.enqueue("unread")).state is State.VERIFIED
