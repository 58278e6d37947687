"""The pauses between attempts."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.backoff import Backoff, pause_s


def test_pauses_grow_up_to_the_limit_and_failures_are_counted() -> None:
    backoff = Backoff(first_s=0.1, longest_s=0.5)
    assert backoff.failures == 0
    assert [backoff.next_s() for _ in range(5)] == [0.1, 0.2, 0.4, 0.5, 0.5]
    assert backoff.failures == 5


def test_a_success_starts_again_from_the_first_pause() -> None:
    backoff = Backoff(first_s=1, longest_s=30, factor=3)
    assert [backoff.next_s() for _ in range(3)] == [1, 3, 9]
    backoff.reset()
    assert (backoff.failures, backoff.next_s()) == (0, 1)


def test_the_first_pause_is_no_longer_than_the_limit() -> None:
    assert Backoff(first_s=5, longest_s=2).next_s() == 2


@pytest.mark.parametrize("factor", [1.01, 2.0, 3, 65536.0])
def test_endless_failures_reach_the_limit_and_do_not_overflow(factor: float) -> None:
    backoff = Backoff(first_s=0.1, longest_s=1.0, factor=factor)
    assert [backoff.next_s() for _ in range(5000)][-1] == 1.0


@given(st.integers(min_value=1, max_value=10**9))
def test_pauses_never_shrink_and_stay_within_their_limits(failures: int) -> None:
    assert 1 <= pause_s(failures, 1.0, 300.0) <= pause_s(failures + 1, 1.0, 300.0) <= 300
