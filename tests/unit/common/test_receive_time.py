from hypothesis import given
from hypothesis import strategies as st

from common.receive_time import Instant, received_at

S = 1_000_000_000


def test_a_stamp_becomes_monotonic_time() -> None:
    now = Instant(monotonic_s=100.0, system_ns=5_000 * S)
    assert received_at(5_000 * S - S // 50, now, emptied_at_s=99.95) == 99.98


def test_a_system_clock_set_back_gives_no_age_below_zero() -> None:
    now = Instant(monotonic_s=100.0, system_ns=1_000 * S)
    assert received_at(5_000 * S, now, emptied_at_s=99.95) == 100.0


def test_a_system_clock_set_ahead_costs_at_most_one_period() -> None:
    now = Instant(monotonic_s=100.0, system_ns=9_000 * S)
    assert received_at(5_000 * S, now, emptied_at_s=99.95) == 99.95


def test_a_middleware_that_does_not_stamp_gives_the_oldest_possible_time() -> None:
    now = Instant(monotonic_s=100.0, system_ns=9_000 * S)
    assert received_at(0, now, emptied_at_s=99.95) == 99.95


@given(
    emptied_at_s=st.floats(0, 1e6),
    later_s=st.floats(0, 10),
    true_share=st.floats(0, 1),
    jump_ns=st.integers(-(10**18), 10**18),
)
def test_whatever_the_clock_does_the_error_is_bounded(
    emptied_at_s: float, later_s: float, true_share: float, jump_ns: int
) -> None:
    """The message arrives somewhere between two looks; in between, the system clock jumps."""
    now_s = emptied_at_s + later_s
    arrived_s = emptied_at_s + later_s * true_share
    system_at_arrival = 10**18
    system_now = system_at_arrival + int((now_s - arrived_s) * S) + jump_ns
    found = received_at(system_at_arrival, Instant(now_s, system_now), emptied_at_s)
    assert emptied_at_s <= found <= now_s
    if jump_ns == 0:
        assert abs(found - arrived_s) < 1e-3
