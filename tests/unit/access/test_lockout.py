"""Who guesses waits, longer and longer; nobody else does; memory has an end."""

import pytest

from common.errors import TooMuchError
from common.reasons import Reason
from gateway.access.lockout import FORGOTTEN_AFTER_S, FREE, LONGEST_WAIT_S, MOST, Lockout
from gateway.access.site import site_of


class Clock:
    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


def waits_s(lockout: Lockout, host: str = "10.0.0.5", credential: str = "a") -> float:
    """How long the next attempt has to wait; 0 for one that is let through."""
    try:
        lockout.admit(host, credential)
    except TooMuchError as error:
        return error.retry_after_s or 0.0
    return 0.0


def test_waits_grow_and_end() -> None:
    clock = Clock()
    lockout = Lockout(clock)
    seen = []
    for _ in range(FREE + 10):
        lockout.failed("10.0.0.5", "a")
        seen.append(waits_s(lockout))
        clock.now_s += seen[-1]
        assert waits_s(lockout) == 0
    assert seen == [0.0] * FREE + [1, 2, 4, 8, 16, 32, LONGEST_WAIT_S, *[LONGEST_WAIT_S] * 3]


def test_only_the_pair_of_address_and_credential_waits() -> None:
    lockout = Lockout(Clock())
    for _ in range(FREE + 1):
        lockout.failed("10.0.0.5", "a")
    with pytest.raises(TooMuchError) as caught:
        lockout.admit("10.0.0.5", "a")
    assert caught.value.reason is Reason.LOCKED_OUT
    assert not waits_s(lockout, credential="b")
    assert not waits_s(lockout, credential="")
    assert not waits_s(lockout, host="10.0.0.6")


def test_a_right_one_and_a_quiet_time_are_new_beginnings() -> None:
    clock = Clock()
    lockout = Lockout(clock)
    for forget in (
        lambda: lockout.succeeded("10.0.0.5", "a"),
        lambda: setattr(clock, "now_s", clock.now_s + FORGOTTEN_AFTER_S + 1),
    ):
        for _ in range(FREE):
            assert not lockout.failed("10.0.0.5", "a")
        forget()
    assert not lockout.failed("10.0.0.5", "a")


def test_memory_is_bounded_and_the_newest_are_remembered() -> None:
    lockout = Lockout(Clock())
    for number in range(3 * MOST):
        for _ in range(FREE + 1):
            lockout.failed(f"10.{number >> 16}.{number >> 8 & 255}.{number & 255}", "a")
    assert len(lockout) == MOST
    newest = 3 * MOST - 1
    assert waits_s(lockout, host=f"10.{newest >> 16}.{newest >> 8 & 255}.{newest & 255}")


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("10.0.0.5", "::ffff:10.0.0.5", True),
        ("2001:db8::1", "2001:db8::ffff:2", True),
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("fe80::1%eth0", "fe80::2%eth1", True),
        ("10.0.0.5", "10.0.0.6", False),
        ("local socket", "local socket", True),
    ],
)
def test_nobody_gets_another_turn_by_another_address_of_their_own(one: str, other: str, same: bool) -> None:
    assert (site_of(one) == site_of(other)) is same
