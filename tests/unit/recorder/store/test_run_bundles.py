"""Folders of the robot's own experiments: whole, or not listed."""

from pathlib import Path

import pytest

from recorder.store import run_bundles
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
    (found,) = bundles.all()
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
    (found,) = RunBundles((tmp_path,)).all()
    assert [file.name for file in found.files] == ["manifest.yaml"]
    assert found.unlisted == 2
