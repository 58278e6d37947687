"""The file that keeps a stop over a restart."""

import threading
from pathlib import Path

import pytest

from common.errors import UserError
from common.private_files import write_private
from drive.motion.episode import Episode
from drive.motion.values import Latch
from drive.processes import stop_file
from drive.processes.stop_file import StopFile, Stops, read_stops

STOPPED = Stops(7, Latch(7, "ben", "a child in the way"))


def test_a_stop_and_its_number_outlive_the_program(tmp_path: Path) -> None:
    path = tmp_path / "state" / "stop.json"
    assert read_stops(path) == Stops()
    moved = Episode(3, "anna", 10, 20, 0.5, 0.1, "released")
    for stops in (STOPPED, Stops(7), Stops(7, STOPPED.latch, moved), Stops(7, lock_left=True)):
        file = StopFile(path)
        file.keep(stops)
        file.close()
        assert read_stops(path) == stops


def test_a_file_of_an_earlier_release_is_read(tmp_path: Path) -> None:
    path = tmp_path / "stop.json"
    path.write_bytes(b'{"last_id": 7, "latch": {"stop_id": 7, "by": "ben", "reason": "a child in the way"}}')
    assert read_stops(path) == STOPPED


@pytest.mark.parametrize(
    "content", [b"", b"{", b"null", b"[]", b'{"last_id": 1}', b'{"latch": {}, "last_id": "x"}']
)
def test_a_file_that_says_nothing_counts_as_a_stop(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "stop.json"
    path.write_bytes(content)
    latch = read_stops(path).latch
    assert latch is not None
    assert "there may have been a stop" in latch.reason


def test_a_disk_that_hangs_delays_no_caller_and_keeps_the_newest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hangs, writing, written = threading.Event(), threading.Event(), []

    def write(_path: Path, content: bytes) -> None:
        writing.set()
        hangs.wait(10)
        written.append(Stops.from_json(content))

    monkeypatch.setattr(stop_file, "write_private", write)
    file = StopFile(tmp_path / "stop.json")
    file.keep(STOPPED)
    assert writing.wait(10)
    for number in range(8, 1000):
        file.keep(Stops(number))
    hangs.set()
    file.close()
    assert written == [STOPPED, Stops(999)]


def test_what_a_full_disk_has_refused_is_written_when_it_has_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: it was tried once, and a robot that was stopped then came up without the stop."""
    refused, has_room, written = threading.Event(), threading.Event(), threading.Event()

    def write(path: Path, content: bytes) -> None:
        if not has_room.is_set():
            refused.set()
            raise UserError("No space left on device")
        write_private(path, content)
        written.set()

    monkeypatch.setattr(stop_file, "write_private", write)
    monkeypatch.setattr(stop_file, "_FIRST_PAUSE_S", 0.01)
    path = tmp_path / "stop.json"
    file = StopFile(path)
    file.keep(STOPPED)
    assert refused.wait(10)
    has_room.set()
    assert written.wait(10)
    file.close()
    assert read_stops(path) == STOPPED


def test_a_disk_that_stays_full_does_not_keep_the_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = threading.Event()

    def write(_path: Path, _content: bytes) -> None:
        refused.set()
        raise UserError("No space left on device")

    monkeypatch.setattr(stop_file, "write_private", write)
    file = StopFile(tmp_path / "stop.json")
    file.keep(STOPPED)
    assert refused.wait(10)
    file.close()
    assert not file._thread.is_alive()
