"""What is remembered of uploads that wait no more: as many as the outbox has room for beside events."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bridge.connection.uploading import QueuedUploads
from bridge.events.values import Event, Position
from bridge.outbox.outbox import outbox
from bridge.outbox.uploads import StoredUploads, _row, most_kept
from bridge.uploads import kept_queue, uploads
from bridge.uploads.queue import State, Upload
from console.client.results import RecordingCopyState
from omniseer.gateway.v1.recording_pb2 import RECORDING_COPY_STATE_VERIFIED
from tests.support.uploading import Robot, Rows, Running, running_uploads

HUB: Any = None
_SMALLEST = 8 << 20
"""Bytes of an outbox."""


def closed(robot: Robot, rows: Any, most_kept: int) -> Any:
    """Uploads that nothing leaves."""
    return running_uploads(robot, HUB, "127.0.0.1:9", (), rows, most_kept=most_kept, only_while_charging=True)


def robot_with(*names: str) -> Robot:
    robot = Robot()
    for name in names:
        robot.add(name, {"data.bin": b"x"})
    return robot


def rows_with(**states: State) -> Rows:
    rows = Rows()
    rows.rows = {name: Upload(recording_id=name, state=state) for name, state in states.items()}
    return rows


async def test_more_than_is_remembered_is_forgotten_the_oldest_verified_first() -> None:
    rows = rows_with(cancelled=State.LOCAL, **{f"old-{number}": State.VERIFIED for number in range(4)})
    async with closed(robot_with("rec-00"), rows, most_kept=3) as running:
        await running.uploads.enqueue("rec-00")
        # Cancelled, it is one more of them.
        await running.uploads.cancel("rec-00")
    assert [name for name, each in rows.rows.items() if each.state is State.LOCAL] == ["cancelled", "rec-00"]
    assert "old-3" in rows.rows
    assert "old-0" not in rows.rows


async def test_an_outbox_that_has_more_rows_than_it_remembers_is_emptied_at_the_start(tmp_path: Path) -> None:
    """The defect: two went with each change of an upload, and until then every event was dropped."""
    name, waiting = "r" * 50, [Upload(recording_id="w", state=State.QUEUED, started_unix_ms=1)]
    settled = [Upload(recording_id=f"{name}{number}", state=State.VERIFIED) for number in range(11_000)]
    async with outbox(tmp_path, 64 << 20) as large:
        await large.position()
        with large._database._use() as db:
            for upload in (*waiting, *settled):
                db.execute("INSERT INTO uploads VALUES (?, ?)", (upload.recording_id, _row(upload)))
    async with outbox(tmp_path, _SMALLEST) as small:
        store, most = StoredUploads(small), most_kept(_SMALLEST)
        async with closed(robot_with("w"), store, most) as running:
            assert len(running.uploads.queue.settled) == most
        kept = await store.uploads()
        assert sum(each.state is State.VERIFIED for each in kept) == most
        assert any(each.recording_id == "w" for each in kept)
        events = [Event("run", number, 1, b"x" * 1000) for number in range(1, 101)]
        await small.append(events, None, Position("run", 100))
        assert (small.facts.events, small.facts.dropped) == (100, 0)


async def test_a_full_outbox_forgets_before_it_remembers() -> None:
    """The defect: a row that did not fit kept others from being forgotten, which would have made room."""

    class Full(Rows):
        async def put_upload(self, upload: Upload) -> None:
            self.full = upload.recording_id not in self.rows and len(self.rows) >= 3
            await super().put_upload(upload)

    rows, robot = Full(), robot_with("c", "without-place")
    known = robot.recordings["without-place"]
    queued = replace(known.copy, state=RecordingCopyState.QUEUED)
    robot.recordings["without-place"] = replace(known, copy=queued)
    rows.rows = rows_with(a=State.VERIFIED, b=State.VERIFIED, c=State.QUEUED).rows
    async with closed(robot, rows, most_kept=2) as running:
        await running.uploads.cancel("without-place")
        assert running.uploads.queue.disk_error == ""
    assert rows.rows.keys() == {"b", "c", "without-place"}


class _Copied:
    """An attempt that succeeds at once."""

    def __init__(self, *_: Any, **__: Any) -> None:
        pass

    async def run(self) -> None:
        pass


def copying(robot: Robot, rows: Rows, most_kept: int) -> Any:
    """Uploads that the rule queues, one after the other."""
    return running_uploads(robot, HUB, "127.0.0.1:9", (), rows, most_kept=most_kept, rule="all")


def known(robot: Robot, name: str, state: RecordingCopyState) -> None:
    """The recorder has a copy in this state."""
    recording = robot.recordings[name]
    robot.recordings[name] = replace(recording, copy=replace(recording.copy, state=state))


async def listed(running: Running, robot: Robot) -> None:
    """The recorder's list is read."""
    running.uploads.queue.begin_listing()
    await running.uploads.consider(list(robot.recordings.values()))
    running.uploads.queue.end_listing()


async def test_a_copy_is_remembered_until_the_recorder_knows_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: beside as many cancelled ones it was forgotten at once, and queued with each list again."""
    monkeypatch.setattr(uploads, "Attempt", _Copied)
    rows = rows_with(a=State.LOCAL, b=State.LOCAL, c=State.LOCAL)
    robot = robot_with("a", "b", "c", "new")
    for name in ("a", "b", "c"):
        known(robot, name, RecordingCopyState.UNKNOWN)
    known(robot, "new", RecordingCopyState.QUEUED)
    async with copying(robot, rows, most_kept=3) as running:
        await listed(running, robot)
        await running.until("new", lambda each: each and each.state is State.VERIFIED)
        for _ in range(2):
            await listed(running, robot)
            assert running.uploads.queue.waiting == []
            reports = QueuedUploads(running.uploads).copies()
            states = {each.recording_id: each.copy.state for each in reports}
            assert states["new"] == RECORDING_COPY_STATE_VERIFIED
        # Once the recorder knows it, it is the first to be forgotten.
        known(robot, "new", RecordingCopyState.VERIFIED)
        await listed(running, robot)
        robot.add("next", {"data.bin": b"x"})
        known(robot, "next", RecordingCopyState.UNKNOWN)
        await listed(running, robot)
        await running.until("next", lambda each: each and each.state is State.VERIFIED)
        assert running.uploads.queue.get("new") is None
        await listed(running, robot)
        assert running.uploads.queue.waiting == []
    assert rows.rows.keys() == {"a", "b", "c", "next"}


async def test_of_copies_that_the_recorder_never_knows_not_all_are_remembered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Those of run bundles, of which it keeps no state."""
    monkeypatch.setattr(uploads, "Attempt", _Copied)
    monkeypatch.setattr(kept_queue, "_MOST_UNCONFIRMED", 2)
    robot = robot_with(*(f"run-{number}" for number in range(6)))
    async with copying(robot, Rows(), most_kept=3) as running:
        for number in range(6):
            await running.uploads.enqueue(f"run-{number}")
            await running.until(f"run-{number}", lambda each: each and each.state is State.VERIFIED)
        assert {each.recording_id for each in running.uploads.queue.settled} == {
            f"run-{n}" for n in range(1, 6)
        }
