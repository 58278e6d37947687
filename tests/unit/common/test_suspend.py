"""A suspend of the computer, on clocks that are moved by hand."""

import pytest

from common import suspend
from common.suspend import SuspendedTime, SuspendWatch

S = 1_000_000_000


class Clocks:
    """CLOCK_MONOTONIC, and CLOCK_BOOTTIME ahead of it by all suspends."""

    CLOCK_BOOTTIME = 7

    def __init__(self) -> None:
        self.monotonic = 5 * S
        self.suspended = 3 * S
        self.interrupted_ns = 0

    def monotonic_ns(self) -> int:
        return self.monotonic

    def clock_gettime_ns(self, _clock: int) -> int:
        self.monotonic += self.interrupted_ns
        now_ns = self.monotonic + self.suspended
        self.monotonic += self.interrupted_ns
        return now_ns


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> Clocks:
    clocks = Clocks()
    monkeypatch.setattr(suspend, "time", clocks)
    return clocks


def test_a_suspend_is_noticed_once(clocks: Clocks) -> None:
    watch = SuspendWatch()
    clocks.monotonic += 10 * S
    assert not watch.resumed()
    clocks.suspended += S // 10
    assert watch.resumed()
    assert not watch.resumed()


def test_a_process_that_is_interrupted_while_it_reads_was_not_suspended(clocks: Clocks) -> None:
    watch = SuspendWatch()
    for interrupted_ns in (S, 0, 2 * S, S, 0):
        clocks.interrupted_ns = interrupted_ns
        assert not watch.resumed()


def test_the_real_clocks_agree() -> None:
    watch = SuspendWatch()
    assert not any(watch.resumed() for _ in range(1000))


def test_the_time_of_all_suspends_is_measured(clocks: Clocks) -> None:
    suspended = SuspendedTime()
    clocks.monotonic += 10 * S
    assert suspended.seconds() == 0
    clocks.suspended += 3600 * S
    assert suspended.seconds() == 3600
    clocks.suspended += 60 * S
    clocks.interrupted_ns = S
    assert 3658 <= suspended.seconds() <= 3660
