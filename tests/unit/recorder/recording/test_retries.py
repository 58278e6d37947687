"""Pauses between attempts at what the disk fails."""

from recorder.recording.retries import FIRST_S, LONGEST_S, Retries
from tests.support.clock import Clock


def is_due(retries: Retries) -> bool:
    return retries.due


def test_pauses_grow_up_to_a_limit_and_begin_anew_after_a_success() -> None:
    clock = Clock()
    retries = Retries(clock)
    assert is_due(retries)
    pauses_s = []
    for failures in range(1, 8):
        retries.failed()
        assert (is_due(retries), retries.failures) == (False, failures)
        began_s = clock.now_s
        while not is_due(retries):
            clock.now_s += 0.5
        pauses_s.append(clock.now_s - began_s)
    assert pauses_s == [FIRST_S, 2, 4, 8, 16, LONGEST_S, LONGEST_S]
    retries.succeeded()
    assert retries.failures == 0
    retries.failed()
    clock.now_s += FIRST_S
    assert is_due(retries)


def test_the_pauses_of_one_thing_are_no_other_one_s() -> None:
    clock = Clock()
    ring, disk = Retries(clock), Retries(clock)
    ring.failed()
    assert disk.due
    disk.failed()
    disk.succeeded()
    assert ring.failures == 1
