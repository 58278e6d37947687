"""What the disk does to a recorder: full, damaged, strange, shared with another one."""

import errno
import os
import resource
import shutil
import subprocess
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from common.errors import (
    NotFoundError,
    PreconditionError,
    RecorderUnreachableError,
    TooMuchError,
    UserError,
)
from recorder.mcap.writer import SegmentWriter
from recorder.recording import ring_recorder
from recorder.recording.lifecycle import State
from recorder.recording.requests import SnapshotOptions, StartOptions
from recorder.store.folder import replace_file
from recorder.store.lock import folder_lock
from recorder.store.manifest import Copy, CopyState, Kind, Manifest, RecordingState, StopReason
from recorder.values import Channel, Gap, GapCause, Sample
from recorder.writing.output import Closed, Head, Output, Shape
from tests.support.recorder_in_process import Running, Source, channel, numbers, running_recorder

MIB = 1024 * 1024
SLOW_S = 0.1


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 32 MiB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=32m", "tmpfs", str(disk)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("this user can't mount a file system")
    yield disk
    subprocess.run(["umount", "--lazy", str(disk)], check=True)


def fill(disk: Path, leave: int) -> Path:
    """Fills a file system up to some free bytes."""
    ballast = disk / "ballast"
    free = int(subprocess.check_output(["df", "--output=avail", "-B1", disk], text=True).split()[1])
    with ballast.open("wb") as file:
        file.write(b"\0" * max(free - leave, 0))
    return ballast


async def recorded(running: Running, size: int = 1000) -> Manifest:
    """A finished recording."""
    await running.operations.start(f"start-{size}", StartOptions())
    Source(running.queue).send(10, size=size // 10)
    done = (await running.operations.stop(f"stop-{size}", "")).recording
    assert done
    return done


async def test_a_disk_full_before_the_start_refuses_it(small_disk: Path) -> None:
    async with running_recorder(small_disk / "root") as running:
        fill(small_disk, 2 * MIB)
        with pytest.raises(TooMuchError, match="no room"):
            await running.operations.start("1", StartOptions())
        assert running.status_reader.phase.state is State.IDLE


async def test_a_disk_that_fills_up_ends_the_recording_and_keeps_what_was_written(small_disk: Path) -> None:
    async with running_recorder(small_disk / "root") as running:
        await running.operations.start("1", StartOptions())
        source = Source(running.queue)
        source.send(100, size=1000)
        await running.written(100)
        ballast = fill(small_disk, 100_000)
        source.send(100, size=20_000)
        await running.until(lambda: running.status_reader.running is None)
        cut = running.status_reader.newest
        assert cut
        assert cut.stop_reason is StopReason.DISK
        assert cut.messages >= 100
        assert running.status_reader.disk_short
        assert "disk" in running.status_reader.last_error
        # With room again it records again, by itself.
        ballast.unlink()
        await running.until(lambda: running.status_reader.phase.state is State.IDLE)
        await running.until(lambda: not running.status_reader.get(cut.id).state.open)
        assert (await running.operations.start("2", StartOptions())).recording


async def test_a_disk_full_at_the_end_leaves_a_recording_that_opens(small_disk: Path) -> None:
    async with running_recorder(small_disk / "root") as running:
        await running.operations.start("1", StartOptions())
        Source(running.queue).send(50, size=1000)
        await running.written(50)
        recording = running.status_reader.running
        assert recording
        ballast = fill(small_disk, 0)
        with suppress(NotFoundError):  # The writer may find the disk full before the stop comes.
            await running.operations.stop("2", "")
        ballast.unlink()
        await running.until(lambda: running.status_reader.phase.state is State.IDLE)
        done = running.status_reader.get(recording.id)
        assert done.state in (RecordingState.COMPLETE, RecordingState.FAULTED)
        assert done.messages == 50
        assert done.metadata


@contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """The kernel refuses to write beyond that size: EFBIG (setrlimit(2)), which is no lack of space."""
    before, highest = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, highest))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (before, highest))


async def test_an_error_of_the_disk_ends_the_recording_and_it_records_again_by_itself(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        await running.operations.start("1", StartOptions())
        source = Source(running.queue)
        source.send(100, size=1000)
        await running.written(100)
        with files_of_at_most(400_000):
            source.send(100, size=20_000)
            await running.until(lambda: running.status_reader.running is None)
            cut = running.status_reader.newest
            assert cut
            assert (cut.state, cut.stop_reason) == (RecordingState.FAULTED, StopReason.ERROR)
            assert "the disk can't be written: File too large" in running.status_reader.last_error
            assert not running.status_reader.disk_short
            with pytest.raises(PreconditionError, match="can't be written"):
                await running.operations.start("2", StartOptions())
        await running.until(lambda: running.status_reader.phase.state is State.IDLE)
        assert running.status_reader.last_error == ""
        found = numbers(running.status_reader, running.status_reader.get(cut.id))
        assert found == list(range(1, len(found) + 1))
        assert len(found) >= 100
        assert (await running.operations.start("3", StartOptions())).recording


async def test_the_gap_of_a_failed_disk_covers_what_was_buffered(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        await running.operations.start("1", StartOptions())
        source = Source(running.queue)
        source.send(100)
        await running.written(100)
        with files_of_at_most(200_000):
            handed_ns = time.time_ns()
            # One, which fails as a whole: of many, some might be on the disk before the others come.
            source.send(size=2_000_000)
            await running.until(lambda: running.status_reader.running is None)
        cut = running.status_reader.newest
        assert cut
        (gap,) = [each for each in cut.gaps if each.cause is GapCause.DISK]
        assert gap.began_ns <= handed_ns < gap.ended_ns


async def test_a_snapshot_has_the_gap_of_a_ring_that_could_not_be_written(tmp_path: Path) -> None:
    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        await running.until(lambda: running.status_reader.writes)
        source = Source(running.queue)
        source.send(10)
        made = await running.operations.snapshot("1", SnapshotOptions(pre_s=10, post_s=60), "someone")
        assert made.recording
        with files_of_at_most(100_000):
            handed_ns = time.time_ns()
            source.send(size=2_000_000)
            await running.until(lambda: "the ring can't be written" in running.status_reader.last_error)
        await running.until(lambda: running.status_reader.writes)
        await running.operations.stop("2", made.recording.id)
        await running.until(lambda: not running.status_reader.snapshots_pending)
        found = running.status_reader.get(made.recording.id)
        (gap,) = [each for each in found.gaps if each.cause is GapCause.DISK]
        assert gap.began_ns <= handed_ns < gap.ended_ns


async def test_the_ring_is_tried_again_after_pauses_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever recordings that end well meanwhile say of the disk: the ring may be on another one."""
    flush, failures_s = SegmentWriter.flush, list[float]()

    def broken(writer: SegmentWriter) -> None:
        # While nothing else is recorded, it would end in FAULTED, and the next start be refused.
        if writer._path.parent.name == "ring" and running.status_reader.running:
            failures_s.append(time.monotonic())
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        flush(writer)

    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        with monkeypatch.context() as patched:
            patched.setattr(SegmentWriter, "flush", broken)
            for number in range(4):
                await running.operations.start(f"start {number}", StartOptions())
                await running.until(lambda: len(failures_s) > number)  # noqa: B023  # waited for
                await running.until(lambda: running.status_reader.ring_failures == len(failures_s))
                done = (await running.operations.stop(f"stop {number}", "")).recording
                assert done
                assert done.state is RecordingState.COMPLETE
        pauses_s = [after - before for before, after in pairwise(failures_s)]
        assert all(pause_s >= least_s for pause_s, least_s in zip(pauses_s, (1.0, 2.0, 4.0), strict=True))


async def test_a_ring_that_is_written_again_has_no_failures_behind_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_writer: SegmentWriter) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        with monkeypatch.context() as patched:
            patched.setattr(SegmentWriter, "flush", broken)
            await running.until(lambda: running.status_reader.ring_failures == 1)
        await running.until(lambda: running.status_reader.writes)
        assert running.status_reader.ring_failures == 1, "an open file proves nothing"
        Source(running.queue).send(10)
        await running.operations.snapshot("1", SnapshotOptions(pre_s=5, post_s=0), "anyone")
        await running.until(lambda: running.status_reader.ring_failures == 0)


async def test_a_fault_while_the_ring_can_not_be_written_is_refused_and_makes_an_incident_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: it was answered as a fault of which no incident is wanted, and was reported no more."""

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("recorder.writing.output.SegmentWriter", full)
    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        with pytest.raises(PreconditionError, match="the ring can't be written at present"):
            await running.operations.report_fault("vision.silent", 3, "nothing comes")
        assert await running.operations.report_fault("battery.low", 2, "15 %") == "", "no incident is wanted"
        monkeypatch.undo()
        await running.until(lambda: running.status_reader.writes)
        made = await running.operations.report_fault("vision.silent", 3, "nothing comes")
        assert running.status_reader.get(made).kind is Kind.INCIDENT


async def test_a_snapshot_over_a_restart_has_its_gap(tmp_path: Path) -> None:
    ring = {"preset": "all"}
    async with running_recorder(tmp_path, ring=ring) as running:
        await running.until(lambda: running.status_reader.writes)
        Source(running.queue).send(10)
    async with running_recorder(tmp_path, ring=ring) as running:
        await running.until(lambda: running.status_reader.writes)
        Source(running.queue, sent=10).send(10)
        made = await running.operations.snapshot("1", SnapshotOptions(pre_s=60, post_s=0), "someone")
        await running.until(lambda: not running.status_reader.snapshots_pending)
        assert made.recording
        found = running.status_reader.get(made.recording.id)
        assert numbers(running.status_reader, found) == list(range(1, 21))
        (gap,) = found.gaps
        first, second = (each for each in found.segments if each.messages)
        assert gap == Gap("", GapCause.INTERRUPTED, first.last_ns or 0, second.first_ns or 0, None)


async def test_a_snapshot_that_was_cut_off_lacks_the_rest_of_its_window(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        done = await recorded(running)
    last_ns = done.segments[-1].last_ns or 0
    until_ns = last_ns + 1_000_000_000
    cut = {"state": RecordingState.RECORDING, "kind": Kind.SNAPSHOT, "window_ns": (0, until_ns)}
    done.model_copy(update=cut).write(tmp_path / "recordings" / done.id)
    async with running_recorder(tmp_path) as running:
        found = running.status_reader.get(done.id)
        assert found.gaps == (Gap("", GapCause.INTERRUPTED, last_ns, until_ns, None),)


@pytest.mark.parametrize("harm", [Path.unlink, lambda path: path.write_bytes(b"")], ids=["gone", "empty"])
async def test_any_file_that_a_power_cut_has_taken_costs_no_other_recording(
    tmp_path: Path, harm: Callable[[Path], object]
) -> None:
    """What was not synchronised may be gone, or have a name and no content."""
    async with running_recorder(tmp_path / "whole", ring={"preset": "all"}) as running:
        intact, hurt = await recorded(running, 1000), await recorded(running, 2000)
        assert hurt.messages == 10
    whole = tmp_path / "whole"
    files = [each.relative_to(whole) for each in whole.rglob("*") if each.is_file()]
    for number, file in enumerate(each for each in files if intact.id not in each.parts):
        root = tmp_path / str(number)
        shutil.copytree(whole, root)
        harm(root / file)
        async with running_recorder(root, ring={"preset": "all"}) as running:
            assert running.status_reader.phase.state is State.IDLE, file
            assert numbers(running.status_reader, running.status_reader.get(intact.id)) == list(
                range(1, 11)
            ), file
            if running.status_reader.has(hurt.id) and file.suffix != ".mcap":
                assert running.status_reader.get(hurt.id).messages == 10, file
            await running.operations.start("again", StartOptions())


async def test_room_is_made_in_the_order_of_retention(small_disk: Path) -> None:
    room = {"min_free_bytes": 8 * MIB}
    async with running_recorder(small_disk / "root", room=room) as running:
        oldest = await recorded(running, MIB)
        copied = await recorded(running, MIB + 1)
        pinned = await recorded(running, MIB + 2)
        waiting = await recorded(running, MIB + 3)
        await running.operations.set_copy(copied.id, Copy(state=CopyState.VERIFIED))
        await running.operations.set_copy(waiting.id, Copy(state=CopyState.QUEUED))
        await running.operations.pin("pin", pinned.id, pinned=True)
        ballast = fill(small_disk, 11 * MIB + MIB // 2)
        await running.operations.start("a", StartOptions())
        assert not running.status_reader.has(copied.id)
        assert running.status_reader.has(oldest.id)
        await running.operations.stop("b", "")
        ballast.unlink()
        fill(small_disk, 6 * MIB)
        with pytest.raises(TooMuchError):
            await running.operations.start("c", StartOptions())
        assert {each.id for each in running.status_reader.recordings} == {pinned.id, waiting.id}


async def test_a_damaged_manifest_is_made_anew_and_kept_aside(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        done = await recorded(running)
    folder = tmp_path / "recordings" / done.id
    (folder / "manifest.json").write_text('{"id": 7', encoding="utf-8")
    async with running_recorder(tmp_path) as running:
        found = running.status_reader.get(done.id)
        assert found.messages == 10
        assert found.state is RecordingState.RECOVERED
        assert found.pinned  # It might have been.
        assert (folder / "manifest.json.damaged").read_text(encoding="utf-8") == '{"id": 7'


@pytest.mark.parametrize("code", [errno.EIO, errno.EMFILE, errno.EACCES])
async def test_a_manifest_that_the_disk_refuses_to_read_is_neither_damaged_nor_written_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    """The defect: label, notes and what was to be copied were lost by an error that ends after a moment."""
    old, cut = await cut_off(tmp_path)
    folder = tmp_path / "recordings" / cut.id
    written = manifest_of(tmp_path, cut)
    opened = Path.open

    def refusing(path: Path, *args: Any, **options: Any) -> Any:
        if path == folder / "manifest.json":
            raise OSError(code, os.strerror(code), str(path))
        return opened(path, *args, **options)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "open", refusing)
        async with running_recorder(tmp_path, boot_id="another") as running:
            assert running.status_reader.phase.state is State.IDLE
            assert running.status_reader.get(cut.id).state is RecordingState.FAULTED
            assert (
                f"recording {cut.id} can't be read: {os.strerror(code)}" in running.status_reader.last_error
            )
            with pytest.raises(PreconditionError, match="can't be read"):
                await running.operations.pin("1", cut.id, pinned=False)
            await running.operations.set_copy(cut.id, Copy(state=CopyState.QUEUED))
            assert running.status_reader.get(old.id).state is RecordingState.COMPLETE
    assert manifest_of(tmp_path, cut) == written
    assert not (folder / "manifest.json.damaged").exists()
    async with running_recorder(tmp_path, boot_id="another") as running:
        found = running.status_reader.get(cut.id)
        assert (found.state, found.messages) == (RecordingState.RECOVERED, 10)
        assert (found.preset, found.pinned) == ("all", False)


async def test_a_damaged_file_beside_a_damaged_manifest_is_a_gap(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        done = await recorded(running)
    folder = tmp_path / "recordings" / done.id
    (folder / "manifest.json").write_text("{", encoding="utf-8")
    (folder / "data" / "000001.mcap").write_bytes(b"damaged")
    async with running_recorder(tmp_path) as running:
        found = running.status_reader.get(done.id)
        assert (found.messages, found.losses.counted, found.losses.uncounted) == (10, None, 1)


async def test_what_is_not_ours_is_neither_listed_nor_deleted(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        done = await recorded(running)
    recordings = tmp_path / "recordings"
    strange = [
        recordings / "notes.txt",
        recordings / "..hidden" / "file",
        recordings / "20260101T000000Z-zzzzzz" / "manifest.json",
        recordings / "20260101T000000Z-abcdef" / "nothing-of-ours",
        recordings / done.id / "data" / "my-notes.txt",
    ]
    for path in strange:
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine", encoding="utf-8")
    (recordings / "20260101T000000Z-aaaaaa").symlink_to(tmp_path / "elsewhere")
    async with running_recorder(tmp_path) as running:
        assert [each.id for each in running.status_reader.recordings] == [done.id]
        await running.operations.delete("1", done.id, b"", force=False)
    assert all(path.read_text(encoding="utf-8") == "mine" for path in strange)
    assert [path.name for path in (recordings / done.id / "data").iterdir()] == ["my-notes.txt"]


async def test_a_second_recorder_on_the_folder_is_refused(tmp_path: Path) -> None:
    with (
        folder_lock(tmp_path),
        pytest.raises(UserError, match=r"another recorder .process [0-9]+. uses the folder"),
        folder_lock(tmp_path),
    ):
        pass


async def test_a_recording_cut_off_in_this_boot_goes_on_and_in_an_earlier_one_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the disk is slow: no client sees an idle recorder in between."""
    async with running_recorder(tmp_path) as running:
        await running.operations.start("1", StartOptions())
        done = (await running.operations.stop("2", "")).recording
        assert done
    # As a recorder leaves it that was killed.
    cut = done.model_copy(update={"state": RecordingState.RECORDING, "stop_reason": None, "ended_unix_ms": 0})
    folder = tmp_path / "recordings" / done.id
    cut.write(folder)
    measured = os.statvfs

    def slowly(path: Path) -> os.statvfs_result:
        time.sleep(SLOW_S)
        return measured(path)

    monkeypatch.setattr("os.statvfs", slowly)
    async with running_recorder(tmp_path) as running:
        assert running.status_reader.running
        assert running.status_reader.running.id == done.id
        with pytest.raises(PreconditionError):
            await running.operations.start("3", StartOptions())
    ended = Manifest.model_validate_json((folder / "manifest.json").read_bytes())
    assert ended.stop_reason is StopReason.SHUTDOWN
    assert [gap.cause.name for gap in ended.gaps] == ["INTERRUPTED"]
    cut.write(folder)
    async with running_recorder(tmp_path, boot_id="another") as running:
        assert running.status_reader.running is None
        found = running.status_reader.get(done.id)
        assert (found.state, found.stop_reason) == (RecordingState.RECOVERED, StopReason.INTERRUPTED)


async def test_a_snapshot_cut_off_in_this_boot_does_not_grow_afterwards(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        done = await recorded(running)
    an_hour_ago_ns = time.monotonic_ns() - 3600 * 1_000_000_000
    cut = {"state": RecordingState.RECORDING, "kind": Kind.SNAPSHOT, "stop_reason": None}
    times = {"started_monotonic_ns": an_hour_ago_ns, "ended_monotonic_ns": 0, "ended_unix_ms": 0}
    done.model_copy(update=cut | times).write(tmp_path / "recordings" / done.id)
    async with running_recorder(tmp_path) as running:
        found = running.status_reader.get(done.id)
        assert found.state is RecordingState.RECOVERED
        calendar_ms = found.ended_unix_ms - found.started_unix_ms
        assert running.status_reader.live(found).duration_ms == max(calendar_ms, 0)


async def test_a_recording_can_be_deleted_on_a_disk_without_a_free_byte(small_disk: Path) -> None:
    async with running_recorder(small_disk / "root") as running:
        done = await recorded(running, MIB)
        fill(small_disk, 0)
        await running.operations.delete("1", done.id, done.sha256, force=False)
        assert running.status_reader.recordings == []
        assert not running.status_reader.folder_of(done).exists()


async def test_a_start_on_a_full_disk_makes_whole_what_was_cut_off_and_then_room(
    small_disk: Path,
) -> None:
    root = small_disk / "root"
    old, cut = await cut_off(root)
    fill(small_disk, 0)
    async with running_recorder(root, boot_id="another") as running:
        await running.until(lambda: running.status_reader.phase.state is State.IDLE)
        found = running.status_reader.get(cut.id)
        assert (found.state, found.messages) == (RecordingState.RECOVERED, 10)
        assert running.status_reader.has(old.id), "what is cut off fits into the reserve"
        assert (await running.operations.start("again", StartOptions())).recording
        assert not running.status_reader.has(old.id)


async def test_a_start_on_a_full_disk_without_a_reserve_deletes_as_ever(small_disk: Path) -> None:
    root = small_disk / "root"
    old, cut = await cut_off(root)
    (root / "reserve").unlink()
    fill(small_disk, 0)
    async with running_recorder(root, boot_id="another") as running:
        await running.until(lambda: running.status_reader.phase.state is State.IDLE)
        assert running.status_reader.get(cut.id).state is RecordingState.RECOVERED
        assert not running.status_reader.has(old.id)


@pytest.mark.parametrize("deleted", [0, 1, 2])
async def test_a_deletion_that_was_cut_off_is_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, deleted: int
) -> None:
    async with running_recorder(tmp_path) as running:
        done = await recorded(running)
        unlink, left = Path.unlink, iter(range(deleted))

        def cut(path: Path, missing_ok: bool = False) -> None:
            if done.id in path.parts and next(left, None) is None:
                raise OSError(errno.EIO, "as if the power were gone")
            unlink(path, missing_ok=missing_ok)

        with monkeypatch.context() as patched:
            patched.setattr(Path, "unlink", cut)
            answer = await running.operations.delete("1", done.id, b"", force=False)
            assert answer.message.endswith("they are deleted later")
    async with running_recorder(tmp_path) as running:
        assert running.status_reader.recordings == []
        assert not running.status_reader.folder_of(done).exists()


async def test_a_deletion_that_the_disk_has_failed_ends_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It seemed done, and took its room until the next start of the recorder."""
    async with running_recorder(tmp_path) as running:
        done = await recorded(running)
        folder, unlink = running.status_reader.folder_of(done), Path.unlink

        def refuse(path: Path, missing_ok: bool = False) -> None:
            if path.suffix == ".mcap":
                raise OSError(errno.EIO, os.strerror(errno.EIO))
            unlink(path, missing_ok=missing_ok)

        with monkeypatch.context() as patched:
            patched.setattr(Path, "unlink", refuse)
            answer = await running.operations.delete("1", done.id, b"", force=False)
            assert answer.message.endswith("they are deleted later")
            # Before it is tried again, with success.
            assert (folder / "data" / "000000.mcap").exists()
            assert running.status_reader.recordings == []
        await running.until(lambda: not folder.exists())


async def cut_off(root: Path) -> tuple[Manifest, Manifest]:
    """Two recordings: one that has ended, and one as it is left when the power is cut."""
    async with running_recorder(root) as running:
        old = await recorded(running, 8 * MIB)
        await running.operations.start("cut", StartOptions())
        Source(running.queue).send(10)
        await running.written(10)
        cut = running.status_reader.running
        assert cut
        (part,) = (running.status_reader.folder_of(cut) / "data").glob("*.part")
        content = part.read_bytes()
    for file in part.parent.iterdir():
        file.unlink()
    part.write_bytes(content)
    cut.write(part.parent.parent)
    return old, cut


async def test_a_file_that_the_disk_refuses_costs_no_other_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, cut = await cut_off(tmp_path)

    def broken(part: Path) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO), str(part))

    with monkeypatch.context() as patched:
        patched.setattr("recorder.store.salvage.recover", broken)
        async with running_recorder(tmp_path, boot_id="another") as running:
            assert running.status_reader.phase.state is State.IDLE
            found = running.status_reader.get(cut.id)
            assert (found.state, found.messages) == (RecordingState.RECOVERED, 0)
            assert GapCause.DISK in {gap.cause for gap in found.gaps}
            assert (await recorded(running, 3000)).messages == 10
    async with running_recorder(tmp_path, boot_id="another") as running:
        assert running.status_reader.get(cut.id).messages == 10, "the disk reads it again"


async def test_a_recording_that_the_disk_refuses_to_complete_is_set_aside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, cut = await cut_off(tmp_path)

    def forbidden(path: Path, content: bytes) -> None:
        if cut.id in path.parts:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        replace_file(path, content)

    monkeypatch.setattr("recorder.store.salvage.replace_file", forbidden)
    monkeypatch.setattr("recorder.store.manifest.replace_file", forbidden)
    async with running_recorder(tmp_path, boot_id="another") as running:
        assert running.status_reader.phase.state is State.IDLE
        assert running.status_reader.get(cut.id).state is RecordingState.FAULTED
        assert f"recording {cut.id} can't be completed: Permission denied" in running.status_reader.last_error
        assert running.status_reader.get(old.id).state is RecordingState.COMPLETE
        assert (await recorded(running, 3000)).messages == 10
        await running.operations.delete("1", cut.id, b"", force=False)
        assert running.status_reader.last_error == ""


async def test_an_unfinished_file_whose_final_name_is_taken_is_kept_aside(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        done = await recorded(running)
    data = tmp_path / "recordings" / done.id / "data"
    shutil.copy(data / "000000.mcap", data / "000000.mcap.part")
    (data / "000000.mcap.damaged").write_text("an earlier one", encoding="utf-8")
    async with running_recorder(tmp_path) as running:
        assert running.status_reader.phase.state is State.IDLE
        found = running.status_reader.get(done.id)
        assert (found.messages, found.segments) == (10, done.segments)
        assert GapCause.DISK in {gap.cause for gap in found.gaps}
        assert (data / "000000.mcap.damaged").read_text(encoding="utf-8") == "an earlier one"
        assert (data / "000000.mcap.damaged.1").exists()
        await running.operations.delete("1", done.id, b"", force=False)
    assert not data.exists()


async def test_the_number_of_a_damaged_file_is_not_used_again(tmp_path: Path) -> None:
    _, cut = await cut_off(tmp_path)
    data = tmp_path / "recordings" / cut.id / "data"
    (data / "000000.mcap").write_bytes(b"damaged")
    (data / "000000.mcap.part").unlink()
    async with running_recorder(tmp_path) as running:
        await running.until(lambda: running.status_reader.phase.state is State.RECORDING)
        Source(running.queue).send(10)
        done = (await running.operations.stop("stop", "")).recording
        assert done
        assert [segment.name for segment in done.segments] == ["data/000001.mcap"]
        assert GapCause.DISK in {gap.cause for gap in done.gaps}, "it is missing, and says so"
        assert done.losses.counted is None
    assert (data / "000000.mcap").read_bytes() == b"damaged"


async def test_the_ring_alone_deletes_no_recording_for_what_others_have_written(small_disk: Path) -> None:
    """A program that fills the disk with its log would cost the robot all recordings, and gain nothing."""
    room = {"min_free_bytes": 8 * MIB}
    async with running_recorder(small_disk / "root", room=room, ring={"preset": "all"}) as running:
        done = await recorded(running, MIB)
        made = await running.operations.snapshot("1", SnapshotOptions(pre_s=10, post_s=600), "someone")
        assert made.recording
        ballast = fill(small_disk, 6 * MIB)
        # It ends with what it has.
        await running.until(lambda: not running.status_reader.snapshots_pending)
        snapshot = running.status_reader.get(made.recording.id)
        assert (snapshot.stop_reason, snapshot.messages) == (StopReason.DISK, 10)
        assert running.status_reader.has(done.id)
        ballast.unlink()
        ballast = fill(small_disk, 0)
        Source(running.queue).send(10, size=MIB)
        await running.until(lambda: "the ring can't be written" in running.status_reader.last_error)
        assert running.status_reader.has(done.id)
        assert running.status_reader.phase.state is State.IDLE
        # Also by itself when there is room again.
        ballast.unlink()
        await running.until(lambda: running.status_reader.writes)
        assert running.status_reader.last_error == ""


async def test_a_ring_on_another_disk_saves_no_recording_from_going(
    tmp_path: Path, small_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ring_recorder, "SEGMENT_S", 0.1)
    ring = {"preset": "all", "directory": tmp_path / "ring"}
    room = {"min_free_bytes": 8 * MIB}
    async with running_recorder(small_disk / "root", room=room, ring=ring) as running:
        old = await recorded(running, 8 * MIB)
        await running.until(lambda: size_of(tmp_path / "ring") > 7 * MIB)
        fill(small_disk, 11 * MIB + MIB // 2)
        assert (await running.operations.start("1", StartOptions())).recording
        assert not running.status_reader.has(old.id)
        assert size_of(tmp_path / "ring") > 7 * MIB


async def test_a_ring_gives_way_on_a_full_disk_of_its_own(
    tmp_path: Path, small_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: it kept what it had, and could not be written."""
    monkeypatch.setattr(ring_recorder, "SEGMENT_S", 0.1)
    ring = {"preset": "all", "seconds": 3600, "directory": small_disk / "ring"}
    async with running_recorder(tmp_path / "root", ring=ring) as running:
        done = await recorded(running, 8 * MIB)
        await running.until(lambda: size_of(small_disk / "ring") > 7 * MIB)
        fill(small_disk, MIB)
        await running.until(lambda: size_of(small_disk / "ring") < MIB)
        assert running.status_reader.has(done.id)


def size_of(ring: Path) -> int:
    """The size of a ring's final segments."""
    return sum(each.stat().st_size for each in ring.glob("*.mcap"))


@asynccontextmanager
async def beside_a_ring(
    small_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[tuple[Running, Manifest]]:
    """A recorder with one recording, and a ring of some final segments, on one disk."""
    monkeypatch.setattr(ring_recorder, "SEGMENT_S", 0.1)
    ring = {"preset": "all", "seconds": 3600}
    room = {"min_free_bytes": 8 * MIB}
    async with running_recorder(small_disk / "root", room=room, ring=ring) as running:
        done = await recorded(running, MIB // 2)
        await running.until(lambda: size_of(small_disk / "root" / "ring") > 400_000)
        yield running, done


async def test_a_recording_on_a_full_disk_leaves_the_ring_what_it_holds(
    small_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: a robot that has recorded for weeks, and is at its limit, had no ring."""
    async with beside_a_ring(small_disk, monkeypatch) as (running, old):
        await running.operations.start("1", StartOptions())
        assert running.status_reader.has(old.id)
        fill(small_disk, 11 * MIB + 3 * MIB // 4)
        await running.until(lambda: not running.status_reader.has(old.id))
        assert size_of(small_disk / "root" / "ring") > 400_000
        assert running.status_reader.running


async def test_a_ring_that_gives_way_is_short_of_room(
    small_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with beside_a_ring(small_disk, monkeypatch) as (running, done):
        await running.until(lambda: not running.status_reader.disk_short)
        # Another program's: no recording goes for that.
        ballast = fill(small_disk, 9 * MIB)
        await running.until(lambda: size_of(small_disk / "root" / "ring") < 400_000)
        ballast.unlink()
        await running.until(lambda: running.status_reader.room.bytes > 10 * MIB)
        assert running.status_reader.disk_short, "for as long as it holds less than it should"
        assert running.status_reader.has(done.id)


async def test_a_copy_that_shares_its_blocks_is_not_deleted_in_vain(small_disk: Path) -> None:
    room = {"min_free_bytes": 8 * MIB}
    async with running_recorder(small_disk / "root", room=room) as running:
        shared, other = await recorded(running, MIB), await recorded(running, MIB + 1)
        for file in (running.status_reader.folder_of(shared) / "data").iterdir():
            (small_disk / file.name).hardlink_to(file)
        fill(small_disk, 11 * MIB + MIB // 2)
        await running.operations.start("a", StartOptions())
        assert running.status_reader.has(shared.id)
        assert not running.status_reader.has(other.id)


async def test_the_room_that_is_reported_includes_what_older_recordings_make(small_disk: Path) -> None:
    """A robot that has recorded for weeks is always at its limit, and can record as long as ever."""
    async with running_recorder(small_disk / "root") as running:
        one, pinned = await recorded(running, 8 * MIB), await recorded(running, 4 * MIB)
        await running.operations.pin("pin", pinned.id, pinned=True)
        ballast = fill(small_disk, 5 * MIB)
        await running.operations.start("1", StartOptions())
        source = Source(running.queue)

        def shown() -> float:
            source.send(size=1000)
            return running.status_reader.room_s or 0.0

        await running.until(shown)
        shown_bytes = (running.status_reader.room_s or 0.0) * running.status_reader.bytes_per_s
        assert one.size + 4 * MIB < shown_bytes < one.size + 6 * MIB
        await running.operations.stop("2", "")
        assert not running.status_reader.disk_short
        ballast.unlink()
        fill(small_disk, 0)
        with pytest.raises(TooMuchError, match="refuses to keep"):
            await running.operations.pin("pin too", one.id, pinned=True)
        await running.until(lambda: running.status_reader.disk_short)


async def test_a_recording_that_was_deleted_by_hand_can_be_deleted(tmp_path: Path) -> None:
    async with running_recorder(tmp_path) as running:
        done = await recorded(running)
        shutil.rmtree(running.status_reader.folder_of(done))
        await running.operations.delete("1", done.id, b"", force=False)
        assert running.status_reader.recordings == []


@contextmanager
def refusing(monkeypatch: pytest.MonkeyPatch, *functions: str) -> Iterator[None]:
    """The disk is full for these functions while the block lasts."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        for function in functions:
            patched.setattr(function, full)
        yield


async def test_a_pin_that_the_disk_refuses_is_no_success_and_is_kept_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: "is pinned", and after a restart it was not."""
    async with running_recorder(tmp_path) as running:
        done = await recorded(running)
        with refusing(monkeypatch, "recorder.store.manifest.replace_file"):
            with pytest.raises(TooMuchError, match=f"{done.id} is pinned, but the disk refuses"):
                await running.operations.pin("1", done.id, pinned=True)
            assert running.status_reader.get(done.id).pinned, "until a restart"
        await running.until(lambda: Manifest.model_validate_json(manifest_of(tmp_path, done)).pinned)
        assert (await running.operations.pin("1", done.id, pinned=True)).message == f"{done.id} is pinned"


def manifest_of(root: Path, recording: Manifest) -> bytes:
    return (root / "recordings" / recording.id / "manifest.json").read_bytes()


async def test_a_snapshot_that_the_disk_refuses_to_complete_is_completed_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: with a ring alone it stayed as it was."""
    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        await running.until(lambda: running.status_reader.writes)
        Source(running.queue).send(10)
        with refusing(monkeypatch, "recorder.store.salvage.replace_file"):
            made = (
                await running.operations.snapshot("1", SnapshotOptions(pre_s=10, post_s=0), "x")
            ).recording
            assert made
            await running.until(lambda: not running.status_reader.snapshots_pending)
            assert running.status_reader.get(made.id).metadata is None
        await running.until(lambda: running.status_reader.get(made.id).metadata)
        assert running.status_reader.get(made.id).messages == 10


async def test_a_deletion_that_the_disk_refuses_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running_recorder(tmp_path) as running:
        one, two = await recorded(running), await recorded(running, 2000)
        with refusing(monkeypatch, "recorder.store.deletion.begin"):
            with pytest.raises(TooMuchError, match=f"refuses to delete {one.id}"):
                await running.operations.delete("1", one.id, b"", force=False)
            assert running.status_reader.get(one.id) == one
        with refusing(monkeypatch, "recorder.store.deletion.complete"):
            answer = await running.operations.delete("2", two.id, b"", force=False)
            assert answer.message.endswith("they are deleted later")
        await running.until(lambda: not (tmp_path / "recordings" / two.id).exists())


async def test_a_stop_that_takes_long_names_the_recording_that_it_stops(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("recorder.recording.operations._STOP_WAIT_S", 0.05)
    async with running_recorder(tmp_path, ring={"preset": "all"}) as running:
        await running.until(lambda: running.status_reader.writes)
        await running.operations.start("1", StartOptions())
        made = (await running.operations.snapshot("2", SnapshotOptions(pre_s=10, post_s=60), "x")).recording
        assert made
        async with running.recorder.changing:
            stopped = await running.operations.stop("3", made.id)
        assert stopped.message == f"{made.id} is still being finalised"
        assert stopped.recording
        assert stopped.recording.id == made.id


async def test_nothing_begins_once_the_recorder_ends(tmp_path: Path) -> None:
    """The defect: the next start found a recording that had been running."""
    async with running_recorder(tmp_path) as running:
        pass
    with pytest.raises(RecorderUnreachableError):
        await running.operations.start("1", StartOptions())
    assert not list((tmp_path / "recordings").iterdir())


def test_a_head_that_is_longer_than_a_segment_does_not_end_it_at_each_message(tmp_path: Path) -> None:
    """Each would write it again: a large map, kept for late subscribers, would keep the disk busy."""
    channel_of_map = channel("/map", latched=True)
    closed: list[Closed] = []

    def sample(of: Channel, size: int) -> Sample:
        data, now_ns = os.urandom(size), time.time_ns()
        return Sample(of, data, now_ns, now_ns, 1, time.monotonic_ns())

    shape = Shape(tmp_path, "{:06d}.mcap".format, 0, "all", False, MIB, 60.0)
    head = Head(latched=[sample(channel_of_map, 3 * MIB)])
    output = Output(shape, lambda: head, lambda _, each: closed.append(each))
    output.open()
    for _ in range(10):
        output.write(sample(channel(), 1000))
        output.flush()
    assert not closed
    for _ in range(12):
        output.write(sample(channel(), 100_000))
        output.flush()
    assert len(closed) == 1, "after its own bytes"
    output.close()
