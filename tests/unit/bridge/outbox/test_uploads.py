"""The queue of uploads over a restart."""

import hashlib
from dataclasses import replace
from pathlib import Path

import pytest
from pydantic import ValidationError

from bridge.config import OutboxSettings
from bridge.connection.uploading import STATES
from bridge.events.values import Event, Position
from bridge.outbox.database import Database
from bridge.outbox.outbox import Outbox, outbox
from bridge.outbox.uploads import StoredUploads, _row, most_kept
from bridge.uploads.queue import MOST_KEPT, MOST_WAITING, Priority, State, Upload
from omniseer.gateway.v1.recording_pb2 import RecordingCopyState

UPLOAD = Upload(
    recording_id="r1",
    label="door",
    priority=Priority.PINNED,
    started_unix_ms=5,
    size=7,
    sha256=b"\x01\xff",
    state=State.FAILED,
    reason="why",
    bytes_done=3,
    failures=2,
    due_s=9.0,
    since_s=8.0,
)


async def test_rows_outlive_the_program(tmp_path: Path) -> None:
    async with outbox(tmp_path, 64 << 20) as kept:
        await StoredUploads(kept).put_upload(UPLOAD)
        await StoredUploads(kept).put_upload(replace(UPLOAD, recording_id="r2"))
        await StoredUploads(kept).delete_uploads(["r2"])
    async with outbox(tmp_path, 64 << 20) as kept:
        assert await StoredUploads(kept).uploads() == [replace(UPLOAD, due_s=0.0, since_s=None)]


async def test_what_an_earlier_version_does_not_know_is_in_few_rows(tmp_path: Path) -> None:
    async with outbox(tmp_path, 64 << 20) as kept:
        for upload in (UPLOAD, replace(UPLOAD, recording_id="run-1", bundle=True)):
            await StoredUploads(kept).put_upload(upload)
        assert ["bundle" in row for row in await kept.upload_rows()] == [False, True]
        assert [each.bundle for each in await StoredUploads(kept).uploads()] == [False, True]


@pytest.mark.parametrize("row", ["", "{}", "[]", '{"state": "QUEUED"}', '{"priority": 1}'])
async def test_a_row_that_is_none_is_left_out(tmp_path: Path, row: str) -> None:
    async with outbox(tmp_path, 64 << 20) as kept:
        await kept.put_upload_row("r1", row)
        assert await StoredUploads(kept).uploads() == []


async def test_a_disk_that_fails_is_an_error_of_the_disk(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    kept = Outbox(tmp_path / "file" / "outbox", 64 << 20)
    with pytest.raises(OSError, match="file"):
        await StoredUploads(kept).put_upload(UPLOAD)
    assert kept.error
    assert kept.refusals == 1
    await kept.close()


def test_the_smallest_outbox_has_room_for_events_beside_the_queue(tmp_path: Path) -> None:
    """The defect: a full queue took more than all of it, and every event was dropped."""
    smallest = 8 << 20
    with pytest.raises(ValidationError):
        OutboxSettings(max_bytes=smallest - 1)
    database = Database(tmp_path, smallest)
    longest = replace(UPLOAD, label="\u00fc" * 100, sha256=b"s" * 32)
    with database._use() as db:
        for number in range(MOST_WAITING + most_kept(smallest)):
            name = hashlib.sha256(str(number).encode()).hexdigest()[:23]
            row = _row(replace(longest, recording_id=name))
            db.execute("INSERT INTO uploads VALUES (?, ?)", (name, row))
    for first in range(1, 1001, 100):
        events = [Event("run", number, 1, b"x" * 1000) for number in range(first, first + 100)]
        database.append(events, database.facts.position, Position("run", first + 99))
    assert database.facts.events == 1000
    assert database.facts.dropped == 0
    database.close()


def test_an_outbox_of_the_default_size_remembers_as_many_as_there_may_be() -> None:
    assert most_kept(OutboxSettings().max_bytes) == MOST_KEPT


def test_every_state_has_its_word_in_the_schema() -> None:
    assert set(STATES) == set(State)
    assert set(STATES.values()) == set(RecordingCopyState.values())
