"""How much may still be written."""

import os
from pathlib import Path

import pytest

from recorder.store.room import RESERVE_BYTES, Disk, Limits, Reserve, RoomToCome, stored, used_bytes

GIB = 1024**3


@pytest.mark.parametrize(
    ("limits", "used", "disk", "room"),
    [
        (Limits(), 0, Disk(10 * GIB, 10 * GIB), 9 * GIB),
        (Limits(), 0, Disk(100 * GIB, 100 * GIB), 95 * GIB),
        (Limits(min_free_bytes=0), 0, Disk(5, 10), 5),
        (Limits(quota_bytes=100, min_free_bytes=0), 70, Disk(1000, 1000), 30),
        (Limits(quota_bytes=100, min_free_bytes=0), 170, Disk(1000, 1000), -70),
        (Limits(min_free_bytes=50), 0, Disk(10, 1000), -40),
    ],
)
def test_the_smaller_of_quota_and_free_space_counts(limits: Limits, used: int, disk: Disk, room: int) -> None:
    assert limits.room_bytes(used, disk) == room


def test_what_has_two_names_counts_once(tmp_path: Path) -> None:
    first = tmp_path / "first"
    first.mkdir()
    (first / "a").write_bytes(os.urandom(100_000))
    once = used_bytes([tmp_path])
    (tmp_path / "b").hardlink_to(first / "a")
    assert used_bytes([tmp_path, first]) == once >= 100_000


def test_the_reserve_is_taken_and_given_back(tmp_path: Path) -> None:
    reserve = Reserve(tmp_path)
    reserve.take()
    reserve.take()
    assert used_bytes([tmp_path]) >= RESERVE_BYTES
    reserve.give()
    reserve.give()
    assert used_bytes([tmp_path]) == 0


def test_what_was_deleted_counts_as_room_until_the_disk_shows_it() -> None:
    to_come = RoomToCome()
    to_come.expect(100, now_s=0.0)
    to_come.came(-5)  # what is written meanwhile
    to_come.came(60)
    assert to_come.bytes(1.0) == 40
    to_come.expect(10, now_s=20.0)
    assert to_come.bytes(49.0) == 50
    assert to_come.bytes(50.0) == 0
    to_come.expect(1, now_s=60.0)
    assert to_come.bytes(60.0) == 1


def test_files_are_listed_with_their_sizes_and_shares(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_bytes(bytes(5000))
    other.hardlink_to(one)
    found = stored([one, other, tmp_path / "missing"])
    assert [each.links for each in found] == [2, 2]
    assert found[0] == found[1]
    assert found[0].bytes >= 5000
