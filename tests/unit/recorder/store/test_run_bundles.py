"""Folders of the robot's own experiments: whole, or not listed."""

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from common.reader_threads import ClosedError
from recorder.store import run_bundles
from recorder.store.manifest import RecordingState
from recorder.store.run_bundles import RunBundles


def test_a_folder_of_too_many_files_is_not_listed_as_if_a_part_were_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(run_bundles, "MAX_FILES", 3)
    folder = tmp_path / "first"
    folder.mkdir()
    (folder / "manifest.yaml").write_text("state: complete\n", encoding="utf-8")
    for number in range(3):
        (folder / f"{number}.jsonl").touch()
    bundles = RunBundles((tmp_path,))
    for _ in range(2):
        assert bundles.all() == []
        assert bundles.get("run-first") is None
    assert caplog.text.count("first is not listed: it has more than 3 files") == 1
    (folder / "0.jsonl").unlink()
    assert [each.id for each in bundles.all()] == ["run-first"]
    assert (found := bundles.get("run-first"))
    assert [file.name for file in found.files] == ["1.jsonl", "2.jsonl", "manifest.yaml"]


def test_files_whose_names_can_t_be_requested_are_counted(tmp_path: Path) -> None:
    folder = tmp_path / "first"
    folder.mkdir()
    (folder / "manifest.yaml").write_text("state: complete\n", encoding="utf-8")
    (folder / "a\nb").touch()
    deep = folder / ("d" * 200) / ("e" * 200)
    deep.mkdir(parents=True)
    (deep / "f").touch()
    (folder / "link").symlink_to("manifest.yaml")
    (folder / "elsewhere").symlink_to(tmp_path)
    assert (found := RunBundles((tmp_path,)).get("run-first"))
    assert [file.name for file in found.files] == ["manifest.yaml"]
    assert found.unlisted == 4


def test_a_folder_that_can_be_read_in_part_is_not_listed_as_if_that_were_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The defect: without what could not be read it was exported, and reported as verified."""
    locked = tmp_path / "first" / "logs"
    locked.mkdir(parents=True)
    (locked / "run.log").touch()
    (tmp_path / "first" / "manifest.yaml").write_text("state: complete\n", encoding="utf-8")
    scandir = os.scandir

    def refusing(path: Any) -> Any:
        if Path(path) == locked:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return scandir(path)

    bundles = RunBundles((tmp_path,))
    with monkeypatch.context() as patched:
        patched.setattr(os, "scandir", refusing)
        for _ in range(2):
            assert bundles.all() == []
            assert bundles.get("run-first") is None
    assert caplog.messages == [f"{tmp_path / 'first'} is not listed: {locked}: Permission denied"]
    assert [each.id for each in bundles.all()] == ["run-first"]
    assert (found := bundles.get("run-first"))
    assert [file.name for file in found.files] == ["logs/run.log", "manifest.yaml"]


def test_a_folder_of_another_user_costs_no_other_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The defect: it kept all recordings from being listed."""
    for name in ("mine", "private"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "manifest.yaml").write_text("state: complete\n", encoding="utf-8")
    stat = os.stat

    def refusing(path: Any, **options: Any) -> Any:
        if "private/" in str(path):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return stat(path, **options)

    monkeypatch.setattr(os, "stat", refusing)
    (found,) = RunBundles((tmp_path,)).all()
    assert found.folder == tmp_path / "mine"
    private = tmp_path / "private"
    assert caplog.messages == [f"{private} is not listed: {private}/manifest.yaml: Permission denied"]


def test_a_configured_folder_that_is_not_there_is_in_the_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    gone = tmp_path / "runs"
    bundles = RunBundles((gone,))
    for _ in range(2):
        assert bundles.all() == []
    assert caplog.messages == [f"{gone} is not listed: {gone}: No such file or directory"]


@pytest.mark.parametrize(
    ("manifest", "state"),
    [
        ("state: complete\n", RecordingState.COMPLETE),
        ("run_id: 7\nstatus: 'complete'  # by the runner\n", RecordingState.COMPLETE),
        ("state: in_progress\n", RecordingState.RECORDING),
        ('run_id: 7\nstatus : "in_progress"\n', RecordingState.RECORDING),
        ("state: incomplete\n", RecordingState.RECOVERED),
        ("", RecordingState.RECOVERED),
        ("state: paused\n", RecordingState.RECOVERED),
        ("state: complete_but_for_the_video\n", RecordingState.RECOVERED),
        ("video:\n  state: complete\n", RecordingState.RECOVERED),
    ],
)
def test_a_bundle_is_complete_or_in_progress_only_if_its_manifest_says_so(
    tmp_path: Path, manifest: str, state: RecordingState
) -> None:
    folder = tmp_path / "first"
    folder.mkdir()
    (folder / "manifest.yaml").write_text(manifest, encoding="utf-8")
    bundles = RunBundles((tmp_path,))
    (listed,) = bundles.all()
    assert listed.state is state
    assert listed.final == (state is not RecordingState.RECORDING)
    assert (found := bundles.get("run-first"))
    assert found.summary == listed


def test_it_can_be_stopped_also_where_no_folder_is_a_bundle(tmp_path: Path) -> None:
    (tmp_path / "none").mkdir()
    bundles = RunBundles((tmp_path,))
    bundles.stop()
    with pytest.raises(ClosedError):
        bundles.all()


def test_a_bundle_in_progress_is_final_once_its_manifest_says_so(tmp_path: Path) -> None:
    folder = tmp_path / "first"
    folder.mkdir()
    manifest = folder / "manifest.yaml"
    bundles = RunBundles((tmp_path,))
    found = []
    for state in ("in_progress", "incomplete", "complete"):
        manifest.write_text(f"state: {state}\n", encoding="utf-8")
        (bundle,) = bundles.all()
        found.append((bundle.state, bundle.final))
    assert found == [
        (RecordingState.RECORDING, False),
        (RecordingState.RECOVERED, True),
        (RecordingState.COMPLETE, True),
    ]
