import threading
import time

from gateway.ros.sampler import Sampler


class Counter:
    def __init__(self) -> None:
        self.takes = 0
        self.enough = threading.Event()

    def take(self) -> None:
        self.takes += 1
        if self.takes == 20:
            self.enough.set()


def test_every_source_is_looked_at_again_and_again() -> None:
    first, second = Counter(), Counter()
    with Sampler([first, second], rate_hz=500) as sampler:
        assert first.enough.wait(10)
        assert second.enough.wait(10)
        assert sampler.last_pass_at_s
    assert abs(first.takes - second.takes) <= 1


def test_nothing_is_looked_at_after_the_end() -> None:
    source = Counter()
    with Sampler([source], rate_hz=500):
        assert source.enough.wait(10)
    ended = source.takes
    assert "ros-sampler" not in {thread.name for thread in threading.enumerate()}
    assert source.takes == ended


def test_the_end_does_not_wait_for_the_next_pass() -> None:
    """At one pass in 100 s, an end that waited for it would take as long."""
    source = Counter()
    started = time.monotonic()
    with Sampler([source], rate_hz=0.01):
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

    with Sampler([SlowOnce()], rate_hz=20):
        assert done.wait(10)
    assert moments[3] - moments[1] > 0.06
