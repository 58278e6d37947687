"""What a process that was killed while it wrote leaves in a recording's folder."""

import errno
import os
from pathlib import Path
from tempfile import mkstemp

import pytest

from recorder.store import deletion
from recorder.store.catalogue import Catalogue
from recorder.store.folder import DATA, MANIFEST, RECORDINGS
from recorder.store.manifest import Kind, Manifest, RecordingState

ID = "20260101T000000Z-abcdef"


def made(root: Path) -> tuple[Catalogue, Manifest, Path]:
    """A recording that has ended, with one segment."""
    catalogue = Catalogue(root)
    manifest = Manifest(id=ID, kind=Kind.MANUAL, state=RecordingState.COMPLETE)
    folder = catalogue.create(manifest)
    (folder / DATA / "000000.mcap").write_bytes(b"segment")
    return catalogue, manifest, folder


def leave_unfinished(folder: Path) -> list[Path]:
    """As tempfile.mkstemp names them, and a copy from a ring on another file system."""
    left = []
    for name, directory in ((MANIFEST, folder), ("metadata.yaml", folder / DATA)):
        handle, path = mkstemp(prefix=f".{name}.", dir=directory)
        os.close(handle)
        left.append(Path(path))
    for number in (7, 1_000_000):
        left.append(folder / DATA / f".{number:06}.mcap.copy")
        left[-1].write_bytes(b"half a segment")
    return left


def test_a_deleted_recording_leaves_no_folder(tmp_path: Path) -> None:
    catalogue, manifest, folder = made(tmp_path)
    leave_unfinished(folder)
    catalogue.delete(manifest)
    assert not folder.exists()


def test_a_deletion_that_was_cut_off_ends_at_the_next_start(tmp_path: Path) -> None:
    _, _, folder = made(tmp_path)
    deletion.begin(folder)
    leave_unfinished(folder)
    again = Catalogue(tmp_path)
    again.load()
    assert not again.all
    assert not folder.exists()


def refuse_segments(monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk fails where a segment is deleted."""
    unlink = Path.unlink

    def refuse(path: Path, missing_ok: bool = False) -> None:
        if path.suffix == ".mcap":
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", refuse)


def test_a_deletion_that_the_disk_has_failed_can_be_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    catalogue, manifest, folder = made(tmp_path)
    with monkeypatch.context() as patched:
        refuse_segments(patched)
        with pytest.raises(OSError, match="Input"):
            catalogue.delete(manifest)
    assert (dict(catalogue.all), catalogue.cut_off) == ({}, {folder})
    catalogue.end_deletions()
    assert not catalogue.cut_off
    assert not folder.exists()


def test_a_deletion_that_fails_again_at_the_start_brings_no_recording_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, _, folder = made(tmp_path)
    deletion.begin(folder)
    again = Catalogue(tmp_path)
    with monkeypatch.context() as patched:
        refuse_segments(patched)
        again.load()
    assert (dict(again.all), again.cut_off) == ({}, {folder})
    again.end_deletions()
    assert not folder.exists()


def test_the_next_start_deletes_them_and_nothing_else(tmp_path: Path) -> None:
    _, manifest, folder = made(tmp_path)
    left = leave_unfinished(folder)
    unknown = [folder / "notes.txt", folder / ".manifest.json.backup-of-mine", folder / DATA / ".copy"]
    for path in unknown:
        path.write_text("not the recorder's", encoding="utf-8")
    again = Catalogue(tmp_path)
    again.load()
    assert again.all == {ID: manifest}
    assert not any(path.exists() for path in left)
    assert all(path.exists() for path in unknown)
    again.delete(manifest)
    assert {path for path in folder.rglob("*") if path.is_file()} == set(unknown)


def test_a_recording_that_never_began_leaves_no_folder(tmp_path: Path) -> None:
    folder = tmp_path / RECORDINGS / ID
    (folder / DATA).mkdir(parents=True)
    handle, _ = mkstemp(prefix=f".{MANIFEST}.", dir=folder)
    os.close(handle)
    Catalogue(tmp_path).load()
    assert not folder.exists()


def test_a_folder_with_the_name_of_a_segment_keeps_no_deletion_from_its_end(tmp_path: Path) -> None:
    catalogue, manifest, folder = made(tmp_path)
    (folder / DATA / "000001.mcap").mkdir()
    catalogue.delete(manifest)
    assert {path.name for path in folder.rglob("*")} == {DATA, "000001.mcap"}


def test_files_that_can_t_be_deleted_cost_no_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, manifest, folder = made(tmp_path)
    leave_unfinished(folder)

    def refuse(_path: Path, *, missing_ok: bool = False) -> None:
        raise OSError(30, f"Read-only file system {missing_ok}")

    monkeypatch.setattr(Path, "unlink", refuse)
    again = Catalogue(tmp_path)
    again.load()
    assert again.all == {ID: manifest}
