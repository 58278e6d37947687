"""The audit log: whole lines, bounded files, and a disk that fails or hangs delays no call."""

import json
import os
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from gateway.access import audit
from gateway.access.audit import AuditLog
from gateway.status.event import ControlAction, ControlResult, Motion
from tests.support.waiting import wait_until


def action(number: int, answer: str = "done") -> ControlAction:
    return ControlAction(
        who="anna",
        address="10.0.0.5:4",
        method="SetPreviewMode",
        request=str(number),
        result=ControlResult.ACCEPTED,
        answer=answer,
        role="operator",
        credential="a" * 12,
    )


def lines(path: Path) -> list[str]:
    return [json.loads(line)["request"] for line in path.read_text().splitlines()]


def test_every_record_is_a_line_and_nothing_breaks_one(tmp_path: Path) -> None:
    log = AuditLog(tmp_path / "a", 1 << 20, 2)
    with log.writing():
        for number in range(50):
            log.record(action(number, answer='a "new"\nline\u2028and \ud800 more'))
    assert lines(tmp_path / "a") == [str(number) for number in range(50)]
    assert log.lost == 0
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o600


def test_a_line_that_stands_for_several_has_their_number_and_times(tmp_path: Path) -> None:
    log = AuditLog(tmp_path / "a", 1 << 20, 2)
    with log.writing():
        log.record(replace(action(0), unix_s=0.5))
        log.record(replace(action(0), unix_s=62.25, count=7000, earlier_unix_s=(2.5, 3.0)))
    one, several = [json.loads(line) for line in (tmp_path / "a").read_text().splitlines()]
    assert one["time"] == "1970-01-01T00:00:00.500+00:00"
    assert one.keys() & {"count", "times"} == set()
    assert (several["time"], several["count"]) == ("1970-01-01T00:01:02.250+00:00", 7000)
    assert several["times"] == ["1970-01-01T00:00:02.500+00:00", "1970-01-01T00:00:03.000+00:00"]


def test_a_line_that_stands_for_several_motions_has_each_of_them(tmp_path: Path) -> None:
    log = AuditLog(tmp_path / "a", 1 << 20, 2)
    motions = (Motion(0.3004, 0.0451, 0.1, "keyboard"), Motion(2.0, 0.4, 0.0, "keyboard"))
    with log.writing():
        log.record(replace(action(0), motion=motions[0]))
        log.record(replace(action(0), count=2, earlier_unix_s=(2.5,), motions=motions))
    one, several = [json.loads(line) for line in (tmp_path / "a").read_text().splitlines()]
    assert "motions" not in one
    assert several["motions"] == [
        {"duration_s": 0.3, "distance_m": 0.045, "turned_rad": 0.1},
        {"duration_s": 2.0, "distance_m": 0.4, "turned_rad": 0.0},
    ]


def test_lines_survive_a_power_loss(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[tuple[str, int]] = []

    def fsync(handle: int) -> None:
        synced.append((str(Path(f"/proc/self/fd/{handle}").readlink()), os.fstat(handle).st_size))

    monkeypatch.setattr(os, "fsync", fsync)
    file = tmp_path / "a"
    log = AuditLog(file, 4096, 2)
    with log.writing():
        for number in range(30):
            log.record(action(number))
    sizes = [size for path, size in synced if path == str(file)]
    assert sizes[-1] == file.stat().st_size, "the newest line"
    assert (tmp_path / "a.1").stat().st_size in sizes, "the last line of an older generation"
    assert str(tmp_path) in dict(synced), "the files' names"


@pytest.mark.parametrize("generations", [1, 3])
def test_files_are_bounded_and_the_newest_lines_stay(tmp_path: Path, generations: int) -> None:
    log = AuditLog(tmp_path / "a", 4096, generations)
    with log.writing():
        for number in range(200):
            log.record(action(number))
    files = sorted(tmp_path.iterdir())
    assert len(files) == generations
    assert all(file.stat().st_size <= 4096 for file in files)
    kept = [
        each for name in ("a.2", "a.1", "a") if (tmp_path / name).exists() for each in lines(tmp_path / name)
    ]
    assert kept == [str(number) for number in range(200 - len(kept), 200)]


def test_a_full_disk_leaves_no_half_line_and_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = AuditLog(tmp_path / "a", 1 << 20, 2)
    really_write = os.write
    room = 600

    def write(handle: int, data: bytes) -> int:
        nonlocal room
        written = really_write(handle, data[:room])
        room -= written
        return written

    monkeypatch.setattr(os, "write", write)
    with log.writing():
        for number in range(10):
            log.record(action(number))
        wait_until(lambda: log.lost > 0, "a line is lost")
        wait_until(lambda: log.error, "the error is reported")
        assert "No space left" in log.error
    kept = lines(tmp_path / "a")
    assert kept == [str(number) for number in range(len(kept))]
    assert 0 < len(kept) < 10
    assert log.lost == 10 - len(kept)


def test_a_disk_that_hangs_delays_no_caller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hangs, goes_on = threading.Event(), threading.Event()

    def append(_path: Path, _line: bytes) -> None:
        hangs.set()
        goes_on.wait(20)

    monkeypatch.setattr(audit, "_append", append)
    log = AuditLog(tmp_path / "a", 1 << 20, 2)
    with log.writing():
        log.record(action(0))
        assert hangs.wait(10)
        for number in range(2000):
            log.record(action(number))
        assert log.lost == 2000 - 1024
        assert "too slow" in log.error
        goes_on.set()


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "elsewhere")
    log = AuditLog(tmp_path / "a", 1 << 20, 2)
    with log.writing():
        log.record(action(0))
    assert not (tmp_path / "elsewhere").exists()
    assert log.lost == 1


def test_without_a_file_the_programs_own_log_has_it(caplog: pytest.LogCaptureFixture) -> None:
    log = AuditLog(None, 4096, 2)
    with caplog.at_level("INFO"), log.writing():
        log.record(action(7))
    assert "audit: anna (operator) from 10.0.0.5:4: SetPreviewMode (7): accepted, done" in caplog.text
