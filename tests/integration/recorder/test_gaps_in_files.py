"""What a single file says of the time before it, by the mcap library: copies are opened one by one."""

from pathlib import Path

from mcap.reader import make_reader

from recorder.recording.lifecycle import State
from recorder.recording.requests import SnapshotOptions, StartOptions
from recorder.store.manifest import Manifest, RecordingState
from recorder.values import Gap, GapCause
from tests.support.recorder_in_process import Running, Source, running_recorder

RING = {"preset": "all"}


def gaps_of(path: Path) -> list[dict[str, str]]:
    with path.open("rb") as file:
        return [each.metadata for each in make_reader(file).iter_metadata() if each.name == "gap"]


def files_of(running: Running, manifest: Manifest) -> list[Path]:
    """Returns those with messages."""
    folder = running.status_reader.folder_of(manifest)
    return [folder / each.name for each in manifest.segments if each.messages]


async def cut_off(root: Path) -> Manifest:
    """Leaves a recording as a killed recorder does."""
    async with running_recorder(root) as running:
        await running.operations.start("1", StartOptions())
        Source(running.queue).send(10)
        done = (await running.operations.stop("2", "")).recording
        assert done
        (left,) = files_of(running, done)
    left.rename(left.with_name(f"{left.name}.part"))
    cut = {"state": RecordingState.RECORDING, "segments": (), "metadata": None, "stop_reason": None}
    done = done.model_copy(update=cut)
    done.write(root / "recordings" / done.id)
    return done


async def test_a_recording_that_goes_on_says_in_its_next_file_what_was_interrupted(tmp_path: Path) -> None:
    """The defect: it was in the manifest and metadata.yaml alone."""
    await cut_off(tmp_path)
    async with running_recorder(tmp_path) as running:
        await running.until(lambda: running.status_reader.phase.state is State.RECORDING)
        Source(running.queue, sent=10).send(10)
        await running.written(20)
        assert running.status_reader.running
        assert running.status_reader.live(running.status_reader.running).losses.uncounted == 1
        done = (await running.operations.stop("3", "")).recording
        assert done
        before, behind = (each for each in done.segments if each.messages)
        gap = Gap("", GapCause.INTERRUPTED, before.last_ns or 0, behind.first_ns or 0, None)
        assert done.all_gaps == (gap,), "once, although file and manifest have it"
        assert running.status_reader.live(done).losses.uncounted == 1
        first, second = files_of(running, done)
        (root_of_it,) = (tmp_path / "recordings").iterdir()
    assert gaps_of(first) == []
    assert gaps_of(second) == [
        {
            "topic": "",
            "cause": "interrupted",
            "began_ns": str(before.last_ns),
            "ended_ns": str(behind.first_ns),
        }
    ]
    (root_of_it / "manifest.json").unlink()
    async with running_recorder(tmp_path) as running:
        assert running.status_reader.get(done.id).all_gaps == (gap,), "the files say it"


async def snapshot_of(running: Running, pre_s: int) -> Manifest:
    options = SnapshotOptions(pre_s=pre_s, post_s=0)
    made = (await running.operations.snapshot(f"{pre_s}", options, "someone")).recording
    assert made
    await running.until(lambda: not running.status_reader.snapshots_pending)
    return running.status_reader.get(made.id)


async def test_a_file_of_the_ring_says_that_it_was_not_written_before(tmp_path: Path) -> None:
    async with running_recorder(tmp_path, ring=RING) as running:
        await running.until(lambda: running.status_reader.writes)
        Source(running.queue).send(10)
    async with running_recorder(tmp_path, ring=RING) as running:
        await running.until(lambda: running.status_reader.writes)
        Source(running.queue, sent=10).send(10)
        found = await snapshot_of(running, 0)
        (only,) = files_of(running, found)
        assert [each["cause"] for each in gaps_of(only)] == ["interrupted"]
        assert found.all_gaps == (), "it ended before the seconds that were requested"
        found = await snapshot_of(running, 60)
        first, second = files_of(running, found)
        assert [each["cause"] for each in (*gaps_of(first), *gaps_of(second))] == ["interrupted"]
        assert len(found.gaps) == 1
        assert found.all_gaps == found.gaps, "once, although file and manifest have it"
