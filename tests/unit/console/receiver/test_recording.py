import os
import select
from contextlib import closing
from pathlib import Path

import pytest

from common.errors import ExitCode, UserError
from console.receiver.recording import Recording
from tests.support.waiting import wait_until


def test_a_file_that_exists_is_never_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "drive.ts"
    file.write_bytes(b"yesterday")
    with pytest.raises(UserError, match=r"drive\.ts exists already") as caught:
        Recording(file)
    assert caught.value.exit_code is ExitCode.USAGE
    assert file.read_bytes() == b"yesterday"


def test_a_place_that_cannot_be_written_is_reported_before_anything_starts(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"can't be written \(No such file or directory\)"):
        Recording(tmp_path / "nowhere" / "drive.ts")


def test_what_several_connections_write_is_kept_in_order(tmp_path: Path) -> None:
    with closing(Recording(tmp_path / "drive.ts")) as recording:
        for number in range(300):
            os.write(recording.pipe, bytes([number % 256]) * 188)
    assert recording.error is None
    assert recording.size_bytes == 300 * 188
    assert recording.file.read_bytes() == b"".join(bytes([number % 256]) * 188 for number in range(300))


def test_a_full_disk_ends_it_and_delays_no_connection() -> None:
    with closing(Recording(Path("/dev/full"))) as recording:
        os.write(recording.pipe, bytes(188))
        wait_until(lambda: recording.error, "the error is known")
        for _ in range(2000):
            wait_until(lambda: poll_once(recording.pipe), "what comes is read")
            os.write(recording.pipe, bytes(1316))
    assert "/dev/full ended early: No space left on device" in str(recording.error)
    assert recording.size_bytes == 0


def poll_once(pipe: int) -> bool:
    """Whether there is room in the pipe."""
    return bool(select.select([], [pipe], [], 1)[1])


def test_a_pipe_or_a_directory_is_not_written_to(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    for there in (tmp_path / "fifo", tmp_path):
        with pytest.raises(UserError, match="exists already"):
            Recording(there)


def test_where_nothing_came_the_name_is_free_again(tmp_path: Path) -> None:
    file = tmp_path / "drive.ts"
    Recording(file).close()
    assert not file.exists()
    with closing(Recording(file)) as recording:
        os.write(recording.pipe, b"x")
    assert file.read_bytes() == b"x"


def test_closing_twice_is_closing_once(tmp_path: Path) -> None:
    recording = Recording(tmp_path / "drive.ts")
    recording.close()
    recording.close()
    assert recording.error is None


def test_what_was_left_out_is_counted(tmp_path: Path) -> None:
    with closing(Recording(tmp_path / "drive.ts")) as recording:
        for _ in range(3):
            recording.add_gap()
    assert recording.gaps == 3
