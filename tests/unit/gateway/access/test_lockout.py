"""Guessing is locked out for growing times, other callers are not, and memory is bounded."""

import pytest

from common.errors import TooMuchError
from common.reasons import Reason
from gateway.access.lockout import FORGET_AFTER_S, FREE_FAILURES, LONGEST_WAIT_S, MAX_ENTRIES, Lockout
from tests.support.clock import Clock


def waits_s(lockout: Lockout, host: str = "10.0.0.5", credential: str = "a") -> float:
    """How long the next attempt has to wait; 0 for one that is admitted."""
    try:
        lockout.check(host, credential)
    except TooMuchError as error:
        return error.retry_after_s or 0.0
    return 0.0


def test_waits_grow_and_end() -> None:
    clock = Clock()
    lockout = Lockout(clock)
    seen = []
    for _ in range(FREE_FAILURES + 10):
        lockout.failed("10.0.0.5", "a")
        seen.append(waits_s(lockout))
        clock.now_s += seen[-1]
        lockout.check("10.0.0.5", "a")
    assert seen == [0.0] * FREE_FAILURES + [1, 2, 4, 8, 16, 32, LONGEST_WAIT_S, *[LONGEST_WAIT_S] * 3]


def test_only_the_pair_of_address_and_credential_waits() -> None:
    lockout = Lockout(Clock())
    for _ in range(FREE_FAILURES + 1):
        lockout.failed("10.0.0.5", "a")
    with pytest.raises(TooMuchError) as caught:
        lockout.check("10.0.0.5", "a")
    assert caught.value.reason is Reason.LOCKED_OUT
    assert not waits_s(lockout, credential="b")
    assert not waits_s(lockout, credential="")
    assert not waits_s(lockout, host="10.0.0.6")


def test_success_and_a_quiet_time_reset_the_count() -> None:
    clock = Clock()
    lockout = Lockout(clock)

    def succeed() -> None:
        lockout.succeeded("10.0.0.5", "a")

    def wait() -> None:
        clock.now_s += FORGET_AFTER_S + 1

    for forget in (succeed, wait):
        for _ in range(FREE_FAILURES):
            assert not lockout.failed("10.0.0.5", "a")
        forget()
    assert not lockout.failed("10.0.0.5", "a")


def test_the_quiet_time_begins_with_the_last_failure() -> None:
    clock = Clock()
    lockout = Lockout(clock)
    for _ in range(FREE_FAILURES):
        assert not lockout.failed("10.0.0.5", "a")
        clock.now_s += FORGET_AFTER_S
    assert lockout.failed("10.0.0.5", "a"), "each came just before the one before it was forgotten"
    for _ in range(4):
        lockout.failed("10.0.0.5", "a")
    clock.now_s += FORGET_AFTER_S + 1
    assert not lockout.failed("10.0.0.5", "a"), "not with the end of the wait"


def test_success_does_not_end_a_wait() -> None:
    """It may be that of another at the same address."""
    clock = Clock()
    lockout = Lockout(clock)
    for _ in range(FREE_FAILURES + 1):
        lockout.failed("10.0.0.5", "a")
    lockout.succeeded("10.0.0.5", "a")
    assert waits_s(lockout) == 1
    clock.now_s += 1
    lockout.succeeded("10.0.0.5", "a")
    assert not lockout.failed("10.0.0.5", "a")


def test_the_wait_is_rounded_up_for_people() -> None:
    clock = Clock()
    lockout = Lockout(clock)
    for _ in range(FREE_FAILURES + 2):
        lockout.failed("10.0.0.5", "a")
    clock.now_s += 0.75
    with pytest.raises(TooMuchError, match=r"^7 wrong credentials .* Try again in 2 s$") as caught:
        lockout.check("10.0.0.5", "a")
    assert caught.value.retry_after_s == 1.25


def test_a_guesser_who_goes_on_is_not_the_first_to_be_dropped() -> None:
    lockout = Lockout(Clock())
    for _ in range(FREE_FAILURES + 1):
        lockout.failed("10.0.0.5", "a")
    for number in range(MAX_ENTRIES - 1):
        lockout.failed("10.0.0.6", str(number))
    lockout.failed("10.0.0.5", "a")
    lockout.failed("10.0.0.6", "one more")
    assert len(vars(lockout)["_entries"]) == MAX_ENTRIES
    assert waits_s(lockout)


def test_memory_is_bounded_and_the_newest_are_remembered() -> None:
    lockout = Lockout(Clock())
    for number in range(3 * MAX_ENTRIES):
        for _ in range(FREE_FAILURES + 1):
            lockout.failed(f"10.{number >> 16}.{number >> 8 & 255}.{number & 255}", "a")
    assert len(vars(lockout)["_entries"]) == MAX_ENTRIES
    newest = 3 * MAX_ENTRIES - 1
    assert waits_s(lockout, host=f"10.{newest >> 16}.{newest >> 8 & 255}.{newest & 255}")
