"""A recording from start to stop, on a real disk, with messages of the test's own."""

import errno
import json
import os
import shutil
import threading
import time
from pathlib import Path

import pytest
import yaml
from rosbags.rosbag2 import Reader

from common.errors import InvalidRequestError, NotFoundError, PreconditionError
from recorder.recording.lifecycle import State
from recorder.recording.requests import SnapshotOptions, StartOptions
from recorder.recording.status_reader import NEWEST_ENDED
from recorder.store.folder import new_id
from recorder.store.manifest import Kind, Manifest, RecordingState, StopReason
from recorder.values import Ended, GapCause, Loss
from recorder.writing.output import Output
from tests.support.recorder_in_process import Running, Source, channel, numbers, running_recorder


async def test_what_was_sent_is_there_and_rosbags_opens_the_folder(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        source = Source(running.queue)
        source.send(5)  # Before the start: not part of it.
        started = await running.operations.start("1", StartOptions(label="first", preset="all"))
        assert started.recording
        assert started.recording.state is RecordingState.RECORDING
        assert running.sources.presets == {"all"}
        source.send(100)
        stopped = await running.operations.stop("2", "")
        done = stopped.recording
        assert done
        assert (done.state, done.stop_reason) == (RecordingState.COMPLETE, StopReason.REQUESTED)
        assert numbers(running.status_reader, done) == list(range(6, 106))
        assert running.status_reader.live(done).losses.counted == 0
        folder = running.status_reader.folder_of(done)
        assert running.sources.presets == frozenset()
    with Reader(folder / "data") as bag:
        assert bag.message_count == 100


async def test_requests_repeated_change_nothing_even_after_a_restart(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        first = await running.operations.start("1", StartOptions())
        again = await running.operations.start("1", StartOptions())
        assert first.recording
        assert again.recording
        assert again.recording.id == first.recording.id
        with pytest.raises(PreconditionError, match="stop it first"):
            await running.operations.start("2", StartOptions())
        with pytest.raises(InvalidRequestError, match="was used for StartRecording"):
            await running.operations.stop("1", "")
        await running.operations.stop("3", "")
        assert (await running.operations.stop("3", "")).message.endswith("has ended")
        with pytest.raises(NotFoundError, match="no recording runs"):
            await running.operations.stop("4", "")
    async with running_recorder(tmp_path) as running:
        after = await running.operations.start("1", StartOptions())
        assert after.recording
        assert after.recording.id == first.recording.id
        assert running.status_reader.phase.state is State.IDLE


async def test_a_repeated_request_is_known_after_the_clock_was_set_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running_recorder(tmp_path) as running:
        first = await running.operations.start("1", StartOptions())
        now = time.time
        monkeypatch.setattr(time, "time", lambda: now() - 3600)
        again = await running.operations.start("1", StartOptions())
        assert first.recording
        assert again.recording
        assert again.recording.id == first.recording.id


async def test_limits_end_a_recording(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        await running.operations.start("1", StartOptions(max_duration_s=1))
        await running.until(lambda: running.status_reader.running is None)
        assert running.status_reader.newest
        assert running.status_reader.newest.stop_reason is StopReason.LIMIT


async def test_a_long_recording_is_cut_into_segments_without_a_loss(tmp_path: Path) -> None:
    segments = {"max_bytes": 1024 * 1024, "max_s": 60}
    async with running_recorder(tmp_path, segments=segments) as running:
        await running.operations.start("1", StartOptions())
        latched = Source(running.queue, channel("/tf_static", latched=True))
        latched.send()
        source = Source(running.queue)
        source.send(60, size=100_000)
        done = (await running.operations.stop("2", "")).recording
        assert done
        assert len(done.segments) >= 5
        assert numbers(running.status_reader, done) == list(range(1, 61))
        # At the head of each segment.
        assert numbers(running.status_reader, done, "/tf_static") == [1] * len(done.segments)


async def test_what_has_ended_is_not_repeated_at_the_head_of_a_segment(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        ended, lasting = (
            Source(running.queue, channel(each, latched=True)) for each in ("/map", "/tf_static")
        )
        ended.send()
        lasting.send()
        running.queue.put([Ended(ended.of)])
        await running.operations.start("1", StartOptions())
        done = (await running.operations.stop("2", "")).recording
        assert done
        assert numbers(running.status_reader, done, "/tf_static") == [1]
        assert numbers(running.status_reader, done, "/map") == []


async def test_a_clock_that_steps_begins_a_segment(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        await running.operations.start("1", StartOptions())
        source = Source(running.queue)
        for hours in (0, 1, -1):
            source.send(10, step_ns=hours * 3_600_000_000_000)
        done = (await running.operations.stop("2", "")).recording
        assert done
        assert [segment.messages for segment in done.segments] == [10, 10, 10]
        assert running.status_reader.live(done).duration_ms < 60_000


@pytest.mark.parametrize("hours", [1, -1])
async def test_a_snapshot_over_a_step_of_the_clock_is_as_long_as_it_was(tmp_path: Path, hours: int) -> None:
    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        await running.until(lambda: running.status_reader.writes)
        source = Source(running.queue)
        source.send(10)
        source.send(10, step_ns=hours * 3_600_000_000_000)
        made = await running.operations.snapshot("1", SnapshotOptions(pre_s=30, post_s=0), "someone")
        assert made.recording
        await running.until(lambda: not running.status_reader.snapshots_pending)
        done = running.status_reader.get(made.recording.id)
        assert [segment.messages for segment in done.segments] == [10, 10]
        assert running.status_reader.live(done).duration_ms < 60_000
        first_ns = done.segments[0].first_ns
        assert first_ns
        assert done.started_unix_ms == first_ns // 1_000_000, "by the clock of its first message"


async def test_a_segment_that_the_disk_refuses_a_snapshot_is_a_gap_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        await running.until(lambda: running.status_reader.writes)
        made = await running.operations.snapshot("1", SnapshotOptions(pre_s=10, post_s=1), "someone")
        assert made.recording
        Source(running.queue).send(10)

        def broken(_source: Path, _target: Path) -> None:
            raise OSError(errno.EIO, os.strerror(errno.EIO))

        monkeypatch.setattr(os, "link", broken)
        await running.until(lambda: not running.status_reader.snapshots_pending)
        done = running.status_reader.get(made.recording.id)
        assert (done.messages, done.losses.counted) == (0, 10)
        assert {gap.cause for gap in done.gaps} == {GapCause.DISK}


async def fill_ring(root: Path) -> None:
    """Has three recorders, one after the other, write ten messages each into the ring."""
    for _ in range(3):
        async with running_recorder(root, ring={"preset": "all"}) as running:
            await running.until(lambda: running.status_reader.writes)
            Source(running.queue).send(10)


async def snapshot_of(running: Running) -> Manifest:
    """A snapshot of all that the ring has, once it is complete."""
    await running.until(lambda: running.status_reader.writes)
    made = await running.operations.snapshot("1", SnapshotOptions(pre_s=30, post_s=0), "someone")
    assert made.recording
    await running.until(lambda: not running.status_reader.snapshots_pending)
    return running.status_reader.get(made.recording.id)


async def test_a_ring_that_the_disk_has_damaged_is_a_gap_of_the_next_snapshot(tmp_path: Path) -> None:
    await fill_ring(tmp_path)
    damaged = sorted((tmp_path / "ring").glob("*.mcap"))[1]
    damaged.write_bytes(bytes(damaged.stat().st_size))
    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        done = await snapshot_of(running)
        assert numbers(running.status_reader, done) == [*range(1, 11)] * 2
        first, second = (each for each in done.segments if each.messages)
        gap = next(each for each in done.gaps if each.cause is GapCause.DISK)
        assert (gap.began_ns, gap.ended_ns) == (first.last_ns, second.first_ns)


async def test_every_time_that_the_recorder_did_not_run_is_a_gap_of_the_next_snapshot(tmp_path: Path) -> None:
    """The defect: only the last one was."""
    await fill_ring(tmp_path)
    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        done = await snapshot_of(running)
        full = [each for each in done.segments if each.messages]
        assert [(gap.cause, gap.began_ns) for gap in done.gaps] == [
            (GapCause.INTERRUPTED, each.last_ns) for each in full
        ]
        assert [gap.ended_ns for gap in done.gaps[:2]] == [each.first_ns for each in full[1:]]


async def test_what_has_ended_last_is_no_question_of_the_calendar(tmp_path: Path) -> None:
    """Which the gateway makes events of: the clock may have been set back since the others ended."""
    in_an_hour_ms = time.time_ns() // 1_000_000 + 3_600_000
    for ordinal in range(1, NEWEST_ENDED + 1):
        folder = tmp_path / "recordings" / new_id(2e9 + ordinal)
        folder.mkdir(parents=True)
        Manifest(
            id=folder.name,
            ordinal=ordinal,
            kind=Kind.MANUAL,
            state=RecordingState.COMPLETE,
            ended_unix_ms=in_an_hour_ms,
        ).write(folder)
    async with running_recorder(tmp_path) as running:
        await running.operations.start("1", StartOptions())
        done = (await running.operations.stop("2", "")).recording
        assert done
        assert running.status_reader.recently_ended[0].id == done.id


async def test_the_ring_is_written_and_its_topics_are_taken_only_once_it_is_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What came between would reach the writer before its output, and be in no segment."""
    released, opens = threading.Event(), Output.open

    def slow(output: Output) -> None:
        released.wait(10)
        opens(output)

    monkeypatch.setattr(Output, "open", slow)
    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        assert not running.status_reader.writes
        assert not running.sources.presets
        released.set()
        await running.until(lambda: running.status_reader.writes)
        assert running.sources.presets == {"all"}


async def test_overlapping_snapshots_share_what_is_on_the_disk(tmp_path: Path) -> None:
    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        source = Source(running.queue)
        await running.until(lambda: running.status_reader.writes)
        source.send(50)
        first = await running.operations.snapshot("1", SnapshotOptions(pre_s=10, post_s=4), "someone")
        second = await running.operations.snapshot("2", SnapshotOptions(pre_s=10, post_s=4), "another")
        assert first.recording
        assert second.recording
        asked_s = time.monotonic()
        source.send(50)
        await running.until(lambda: not running.status_reader.snapshots_pending)
        assert time.monotonic() - asked_s < 8
        made = [running.status_reader.get(each.recording.id) for each in (first, second) if each.recording]
        for each in made:
            assert (each.state, each.kind) == (RecordingState.COMPLETE, Kind.SNAPSHOT)
            assert numbers(running.status_reader, each) == list(range(1, 101))
        inodes = [
            {
                (running.status_reader.folder_of(each) / segment.name).stat().st_ino
                for segment in each.segments
            }
            for each in made
        ]
        assert inodes[0] & inodes[1]
        assert made[0].trigger == "someone"


async def test_a_fault_makes_an_incident_and_its_repetition_none(tmp_path: Path) -> None:
    incidents = {"pre_s": 10, "post_s": 0, "cooldown_s": 60}
    async with running_recorder(tmp_path, ring={"preset": "all"}, incidents=incidents) as running:
        Source(running.queue).send(10)
        assert await running.operations.report_fault("vision.slow", 2, "slow") == ""
        made = await running.operations.report_fault("vision.silent", 3, "nothing comes")
        assert made
        assert await running.operations.report_fault("vision.silent", 3, "nothing comes") == made
        await running.until(lambda: not running.status_reader.snapshots_pending)
        incident = running.status_reader.get(made)
        assert incident.kind is Kind.INCIDENT
        assert incident.trigger == "vision.silent: nothing comes"
        assert len(running.status_reader.recordings) == 1


async def test_deleting_needs_a_reason_that_is_good_enough(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        await running.operations.start("1", StartOptions())
        done = (await running.operations.stop("2", "")).recording
        assert done
        with pytest.raises(PreconditionError, match="has changed"):
            await running.operations.delete("3", done.id, b"x" * 32, force=False)
        await running.operations.pin("4", done.id, pinned=True)
        with pytest.raises(PreconditionError, match="pinned"):
            await running.operations.delete("5", done.id, done.sha256, force=False)
        await running.operations.delete("6", done.id, done.sha256, force=True)
        assert running.status_reader.recordings == []
        assert not running.status_reader.folder_of(done).exists()
        assert (await running.operations.delete("6", done.id, done.sha256, force=True)).message
        with pytest.raises(NotFoundError):
            await running.operations.delete("7", done.id, b"", force=False)


async def test_a_copy_has_what_the_manifest_has(tmp_path: Path) -> None:
    """The files of a recording are copied, its manifest is not."""
    options = StartOptions(label="lap 1", notes="wet: floor\n- and dark")
    async with running_recorder(tmp_path) as running:
        await running.operations.start("1", options)
        source = Source(running.queue)
        source.send()
        running.queue.put([Loss(source.of, GapCause.MIDDLEWARE, 5, 7, 3)])
        done = (await running.operations.stop("2", "")).recording
        assert done
        copied = tmp_path / "copy"
        for file in done.files:
            (copied / file.name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(running.status_reader.folder_of(done) / file.name, copied / file.name)
    with Reader(copied / "data") as bag:
        assert bag.message_count == 1
    content = yaml.safe_load((copied / "data" / "metadata.yaml").read_text(encoding="utf-8"))
    about = content["rosbag2_bagfile_information"]["custom_data"]
    assert (about["id"], about["label"], about["notes"]) == (done.id, options.label, options.notes)
    assert (about["state"], about["stop_reason"], about["preset"]) == ("complete", "requested", "all")
    gap = {"topic": "/odom", "cause": "middleware", "began_ns": "5", "ended_ns": "7", "messages": "3"}
    assert json.loads(about["gaps"]) == [gap]
    assert all(isinstance(text, str) for text in about.values()), "rosbag2 reads nothing else"
