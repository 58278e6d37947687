from pathlib import Path

import pytest

from common.errors import ExitCode, UserError
from console.receiver.recording import Recording


def test_a_file_that_exists_is_never_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "drive.ts"
    file.write_bytes(b"yesterday")
    with pytest.raises(UserError, match=r"drive\.ts exists already") as caught:
        Recording(file)
    assert caught.value.exit_code is ExitCode.USAGE
    assert file.read_bytes() == b"yesterday"


def test_a_place_that_cannot_be_written_is_told_before_anything_starts(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"can't be written \(No such file or directory\)"):
        Recording(tmp_path / "nowhere" / "drive.ts")


def test_the_first_failure_counts_and_ends_it(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "drive.ts")
    assert recording.is_writable()
    recording.fail("No space left on the resource.")
    recording.fail("something later")
    assert "ended early: No space left" in str(recording.trouble)
    assert not recording.is_writable()


def test_a_file_that_was_taken_away_fails_at_the_next_connection(tmp_path: Path) -> None:
    folder = tmp_path / "stick"
    folder.mkdir()
    recording = Recording(folder / "drive.ts")
    recording.file.unlink()
    folder.rmdir()
    assert not recording.is_writable()
    assert "No such file" in str(recording.trouble)
    assert recording.size_bytes() == 0


def test_what_was_left_out_is_counted(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "drive.ts")
    for _ in range(3):
        recording.leave_out()
    assert recording.gaps == 3
