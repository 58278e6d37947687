"""`robot-recorder recover` on what a recorder has left that was cut off."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from common.errors import UserError
from recorder.cli import app
from recorder.mcap.reading import summarise
from recorder.recording.requests import StartOptions
from recorder.recover_disk import recover_below
from recorder.store.folder import SEGMENT
from recorder.store.lock import folder_lock
from recorder.store.manifest import Manifest, RecordingState, StopReason
from tests.support.recorder_in_process import Source, numbers, running_recorder


async def cut_off(root: Path) -> Path:
    """A folder of recordings as a power cut leaves it; returns the folder of its one recording."""
    async with running_recorder(root) as running:
        await running.operations.start("1", StartOptions())
        Source(running.queue).send(50)
        await running.written(50)
        open_manifest = running.status_reader.running
        assert open_manifest
        folder = running.status_reader.folder_of(open_manifest)
        part = next((folder / "data").glob("*.part"))
        content = part.read_bytes()
    for file in (folder / "data").iterdir():
        file.unlink()
    part.write_bytes(content[:-3])
    open_manifest.write(folder)
    return folder


async def test_a_disk_is_made_whole_without_a_service(tmp_path: Path) -> None:
    folder = await cut_off(tmp_path)
    printed = CliRunner().invoke(app, ["recover", str(tmp_path), "--json"])
    assert printed.exit_code == 0, printed.output
    (found,) = json.loads(printed.stdout)
    assert found["file"].endswith(".mcap")
    assert 0 < found["messages"] <= 50
    manifest = Manifest.model_validate_json((folder / "manifest.json").read_bytes())
    assert (manifest.state, manifest.stop_reason) == (RecordingState.RECOVERED, StopReason.INTERRUPTED)
    assert manifest.messages == found["messages"]
    assert (folder / "data" / "metadata.yaml").exists()
    again = CliRunner().invoke(app, ["recover", str(tmp_path)])
    assert "nothing was cut off" in again.output


async def test_one_file_is_enough(tmp_path: Path) -> None:
    folder = await cut_off(tmp_path)
    (found,) = recover_below(next((folder / "data").glob("*.part")))
    assert SEGMENT.fullmatch(f"data/{Path(found.file).name}")
    summary = summarise(Path(found.file))
    assert summary
    assert summary.messages == found.messages > 0


@pytest.mark.parametrize(
    "named", [".", "root", "root/recordings", "root/recordings/{id}", "root/recordings/{id}/data", "{part}"]
)
async def test_what_a_recorder_writes_is_refused_whatever_is_named(tmp_path: Path, named: str) -> None:
    root = tmp_path / "root"
    with folder_lock(root):
        async with running_recorder(root) as running:
            await running.operations.start("1", StartOptions())
            Source(running.queue).send(50)
            await running.written(50)
            (part,) = root.rglob("*.part")
            path = tmp_path / named.format(id=part.parent.parent.name, part=part)
            with pytest.raises(UserError, match="another recorder"):
                recover_below(path)
            done = (await running.operations.stop("2", "")).recording
            assert done
            assert numbers(running.status_reader, done) == list(range(1, 51))


def test_a_ring_of_its_own_is_refused_while_it_is_written(tmp_path: Path) -> None:
    with folder_lock(tmp_path):
        (tmp_path / "00000000.mcap.part").touch()
        with pytest.raises(UserError, match="another recorder"):
            recover_below(tmp_path)


async def test_a_damaged_file_is_kept(tmp_path: Path) -> None:
    folder = await cut_off(tmp_path)
    (part,) = (folder / "data").iterdir()
    content = part.read_bytes()[:200]
    part.write_bytes(content)
    printed = CliRunner().invoke(app, ["recover", str(tmp_path)])
    assert printed.exit_code == 0
    assert "its damage leaves no message; it is kept" in printed.output
    assert (folder / "data" / "000000.mcap.damaged").read_bytes() == content


def test_a_final_file_is_refused(tmp_path: Path) -> None:
    final = tmp_path / "000000.mcap"
    final.write_bytes(b"final")
    with pytest.raises(UserError, match="not unfinished"):
        recover_below(final)
    assert final.read_bytes() == b"final"


def test_what_is_in_use_or_missing_is_refused(tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    with folder_lock(tmp_path), pytest.raises(UserError, match="another recorder"):
        recover_below(tmp_path)
    with pytest.raises(UserError, match="does not exist"):
        recover_below(tmp_path / "nowhere")
