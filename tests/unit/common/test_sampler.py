import threading
import time
from collections.abc import Sequence

import pytest

from common.sampler import Sampler, Takes
from gateway.status.board import Board


class Counter:
    def __init__(self) -> None:
        self.takes = 0
        self.enough = threading.Event()

    def take(self) -> None:
        self.takes += 1
        if self.takes == 20:
            self.enough.set()


def sampler(sources: Sequence[Takes], rate_hz: float = 500.0) -> Sampler:
    return Sampler(sources, Board(), rate_hz)


def test_every_source_is_looked_at_again_and_again() -> None:
    first, second = Counter(), Counter()
    with sampler([first, second]):
        assert first.enough.wait(10)
        assert second.enough.wait(10)
    assert abs(first.takes - second.takes) <= 1


def test_nothing_is_looked_at_after_the_end() -> None:
    source = Counter()
    with sampler([source]):
        assert source.enough.wait(10)
    ended = source.takes
    assert "ros-sampler" not in {thread.name for thread in threading.enumerate()}
    assert source.takes == ended


def test_the_end_does_not_wait_for_the_next_pass() -> None:
    """At one pass in 100 s, an end that waited for it would take as long."""
    source = Counter()
    started = time.monotonic()
    with sampler([source], rate_hz=0.01):
        pass
    assert time.monotonic() - started < 50


def test_a_late_pass_is_not_made_up_for() -> None:
    """One slow pass of ten periods is followed by one pass, not by ten at once."""
    moments: list[float] = []
    done = threading.Event()

    class SlowOnce:
        def take(self) -> None:
            moments.append(time.monotonic())
            if len(moments) == 1:
                threading.Event().wait(0.5)
            if len(moments) == 4:
                done.set()

    with sampler([SlowOnce()], rate_hz=20):
        assert done.wait(10)
    assert moments[3] - moments[1] > 0.06


@pytest.mark.parametrize(
    "error", [RuntimeError("rmw"), UnicodeDecodeError("utf-8", b"\xff", 0, 1, "no"), KeyError(1)]
)
def test_a_source_that_raises_costs_the_others_nothing(
    error: Exception, caplog: pytest.LogCaptureFixture
) -> None:
    class Broken:
        def take(self) -> None:
            raise error

    source = Counter()
    with sampler([Broken(), source]):
        assert source.enough.wait(10)
    assert sum("can't be sampled" in line for line in caplog.messages) == 1, "one line, not one per pass"


def test_the_end_of_each_pass_is_on_the_board() -> None:
    board, source, entered, going_on = Board(), Counter(), threading.Event(), threading.Event()

    class Blocking:
        def take(self) -> None:
            if source.enough.is_set():
                entered.set()
                going_on.wait(10)

    with Sampler([source, Blocking()], board, 500):
        assert entered.wait(10)
        blocked_s = board.ros_passed_s
        assert blocked_s is not None
        assert not going_on.wait(0.05)
        assert board.ros_passed_s == blocked_s
        going_on.set()
