"""What the soak makes of its readings."""

import pytest

from bench.soak_readings import Reading, judge

ROUNDS = 1000
WARMING_UP = [Reading(60.0 + round_ / 2, 20) for round_ in range(100)]


def readings(resident_mib_per_round: float = 0.0, rounds_per_descriptor: int = ROUNDS) -> list[Reading]:
    """After some warming up, figures that go up and down, and maybe grow."""
    return WARMING_UP + [
        Reading(110.0 + round_ % 7 + round_ * resident_mib_per_round, 22 + round_ // rounds_per_descriptor)
        for round_ in range(ROUNDS - len(WARMING_UP))
    ]


def test_what_stays_level_passes() -> None:
    memory, descriptors = judge(readings(), "soak.", "the program", "work")
    assert (memory.value, descriptors.value) == (0, 0)
    assert memory.ok
    assert descriptors.ok


def test_ten_kib_a_round_are_seen() -> None:
    memory, descriptors = judge(readings(resident_mib_per_round=0.01), "soak.", "the program", "work")
    assert memory.value == pytest.approx(8, rel=0.05)
    assert not memory.ok
    assert descriptors.ok


def test_one_descriptor_in_three_hundred_rounds_is_seen() -> None:
    _, descriptors = judge(readings(rounds_per_descriptor=300), "soak.", "the program", "work")
    assert not descriptors.ok
