"""What the soak makes of its readings."""

import pytest

from bench.soak.readings import Reading, judge, judge_together

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


def test_several_programs_are_judged_by_the_one_that_grew_most() -> None:
    level, growing = readings(), readings(resident_mib_per_round=0.01, rounds_per_descriptor=300)
    both = [{"steady": one, "leaking": other} for one, other in zip(level, growing, strict=True)]
    memory, descriptors, threads, logged, failed = judge_together(both, 3, "soak.", "work")
    assert memory.value == pytest.approx(8, rel=0.05)
    assert "(leaking)" in memory.what
    assert (descriptors.ok, threads.ok, logged.ok) == (False, True, True)
    assert (failed.value, failed.ok) == (3, False)


def test_a_log_that_grows_faster_and_faster_is_seen() -> None:
    quiet = [{"one": Reading(100, 20, 5, round_ * 100)} for round_ in range(ROUNDS)]
    louder = [{"one": Reading(100, 20, 5, round_ * round_)} for round_ in range(ROUNDS)]
    *_, steady, _ = judge_together(quiet, 0, "soak.", "work")
    *_, faster, _ = judge_together(louder, 0, "soak.", "work")
    assert (steady.ok, faster.ok) == (True, False)


def test_threads_that_stay_are_seen() -> None:
    staying = [{"one": Reading(100, 20, 5 + round_ // 200)} for round_ in range(ROUNDS)]
    _, _, threads, *_ = judge_together(staying, 0, "soak.", "work")
    assert not threads.ok
