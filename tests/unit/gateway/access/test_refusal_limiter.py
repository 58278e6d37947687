"""A few refusals are reported one by one, a flood by its number."""

from hypothesis import given
from hypothesis import strategies as st

from gateway.access.refusal_limiter import BURST, MAX_CALLERS, REFILL_S, RefusalLimiter


class Clock:
    now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


def test_a_burst_is_reported_and_then_one_a_minute_with_the_number_of_the_rest() -> None:
    clock = Clock()
    limiter = RefusalLimiter(clock)
    assert [limiter.take("10.0.0.9") for _ in range(BURST + 3)] == [0] * BURST + [None] * 3
    clock.now_s += REFILL_S
    assert [limiter.take("10.0.0.9") for _ in range(2)] == [3, None]
    clock.now_s += REFILL_S * BURST * 2
    assert [limiter.take("10.0.0.9") for _ in range(BURST + 1)] == [1] + [0] * (BURST - 1) + [None]


def test_one_callers_flood_hides_no_other_caller() -> None:
    limiter = RefusalLimiter(Clock())
    for _ in range(1000):
        limiter.take("10.0.0.9")
    assert limiter.take("ben") == 0


def test_memory_is_bounded_and_the_least_recently_used_bucket_is_dropped() -> None:
    limiter = RefusalLimiter(Clock())
    for _ in range(BURST):
        limiter.take("first")
    for number in range(MAX_CALLERS - 1):
        limiter.take(str(number))
    assert limiter.take("first") is None
    for number in range(MAX_CALLERS):
        limiter.take(f"more {number}")
    assert len(vars(limiter)["_callers"]) == MAX_CALLERS
    assert limiter.take("first") == 0


@given(st.lists(st.floats(0, 3 * REFILL_S), max_size=200))
def test_none_is_lost_from_the_count_and_the_log_grows_slowly(pauses_s: list[float]) -> None:
    clock = Clock()
    limiter = RefusalLimiter(clock)
    reported = suppressed = 0
    for pause_s in pauses_s:
        clock.now_s += pause_s
        count = limiter.take("x")
        if count is None:
            suppressed += 1
        else:
            assert count == suppressed
            reported, suppressed = reported + 1, 0
    assert reported <= BURST + sum(pauses_s) / REFILL_S
