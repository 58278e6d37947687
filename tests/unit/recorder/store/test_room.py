"""How much may still be written."""

import os
from pathlib import Path

import pytest

from recorder.store.room import RESERVE_BYTES, Disk, Limits, Reserve, used_bytes

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
