"""The bridge has lost its queue, or can't read it: what the recorder still expects is copied all the same."""

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bridge.outbox.database import NAME
from bridge.outbox.outbox import outbox
from bridge.outbox.uploads import StoredUploads
from bridge.uploads import kept_queue
from bridge.uploads.queue import Priority, State, Upload, in_order
from console.client.results import RecordingCopyState
from tests.support.uploading import Robot, Rows, running_uploads

HUB: Any = None


def robot_with(**states: RecordingCopyState) -> Robot:
    """A robot whose recorder has recordings with such copies."""
    robot = Robot()
    for name, state in states.items():
        known = robot.add(name, {"data.bin": b"x"})
        robot.recordings[name] = replace(known, copy=replace(known.copy, state=state))
    return robot


def closed(robot: Robot, rows: Any, **settings: Any) -> Any:
    """Uploads that nothing leaves."""
    return running_uploads(robot, HUB, "127.0.0.1:9", (), rows, only_while_charging=True, **settings)


async def test_what_was_requested_by_hand_is_queued_again(tmp_path: Path) -> None:
    robot = robot_with(one=RecordingCopyState.QUEUED)
    async with outbox(tmp_path, 64 << 20) as kept, closed(robot, StoredUploads(kept)) as running:
        await running.uploads.enqueue("one")
    os.truncate(tmp_path / NAME, 1000)
    async with outbox(tmp_path, 64 << 20) as kept, closed(robot, StoredUploads(kept)) as running:
        assert running.upload("one") is None, "the queue is lost"
        await running.uploads.consider(robot.recordings.values())
        (again,) = running.uploads.queue.waiting
        assert (again.recording_id, again.priority) == ("one", Priority.BY_HAND)
        await running.uploads.cancel("one")
        await running.uploads.consider(robot.recordings.values())
        assert not running.uploads.queue.waiting, "the recorder does not know yet that it was cancelled"


async def test_only_copies_that_the_recorder_expects_are() -> None:
    states = {state.value: state for state in RecordingCopyState}
    robot = robot_with(**states)
    async with closed(robot, Rows()) as running:
        await running.uploads.consider(robot.recordings.values())
        waiting = {each.recording_id for each in running.uploads.queue.waiting}
    assert waiting == set(states) - {"unknown", "verified"}


async def test_a_queue_that_can_t_be_read_is_read_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_queue, "FIRST_PAUSE_S", 0.1)
    rows = Rows()
    rows.rows["cancelled"] = Upload(recording_id="cancelled", state=State.LOCAL)
    rows.rows["one"] = Upload(recording_id="one", state=State.VERIFIED)
    failures = [OSError(5, "Input/output error"), OSError(5, "Input/output error")]
    read = rows.uploads

    async def fails() -> list[Upload]:
        if failures:
            raise failures.pop()
        return await read()

    rows.uploads = fails  # type: ignore[method-assign]  # the disk of this test
    robot = robot_with(one=RecordingCopyState.QUEUED)
    async with closed(robot, rows) as running:
        assert "Input/output error" in running.uploads.queue.disk_error
        await running.uploads.consider(robot.recordings.values())
        await running.until("cancelled", lambda found: found is not None, 10)
        assert running.uploads.queue.disk_error == ""
        kept = running.upload("one")
        assert kept
        assert kept.state is not State.VERIFIED, "what has happened meanwhile counts"


async def test_a_full_queue_is_not_sorted_for_each_recording_of_the_list(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(kept_queue, "MOST_WAITING", 50)
    sorted_times = 0

    def counted(found: Iterable[Upload]) -> list[Upload]:
        nonlocal sorted_times
        sorted_times += 1
        return in_order(found)

    robot = robot_with(**{f"rec-{number}": RecordingCopyState.UNKNOWN for number in range(1000)})
    async with closed(robot, Rows(), rule="all") as running:
        await running.uploads.consider(robot.recordings.values())
        monkeypatch.setattr(kept_queue, "in_order", counted)
        await running.uploads.consider(robot.recordings.values())
        assert sorted_times < 10
        assert [each.recording_id for each in running.uploads.queue.waiting] == sorted(robot.recordings)[:50]
