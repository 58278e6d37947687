"""A few refused attempts are told of one by one, a flood by its number."""

from hypothesis import given
from hypothesis import strategies as st

from gateway.access.attempts import EVERY_S, FREE, MOST, Attempts


class Clock:
    now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


def test_the_first_ones_are_told_of_and_then_one_a_minute_with_the_number_of_the_rest() -> None:
    clock = Clock()
    attempts = Attempts(clock)
    assert [attempts.left_out("10.0.0.9") for _ in range(FREE + 3)] == [0] * FREE + [None] * 3
    clock.now_s += EVERY_S
    assert [attempts.left_out("10.0.0.9") for _ in range(2)] == [3, None]
    clock.now_s += EVERY_S * FREE * 2
    assert [attempts.left_out("10.0.0.9") for _ in range(FREE + 1)] == [1] + [0] * (FREE - 1) + [None]


def test_one_caller_s_flood_hides_nobody_else() -> None:
    attempts = Attempts(Clock())
    for _ in range(1000):
        attempts.left_out("10.0.0.9")
    assert attempts.left_out("ben") == 0


def test_memory_has_an_end_and_forgets_who_tried_longest_ago() -> None:
    attempts = Attempts(Clock())
    for _ in range(FREE):
        attempts.left_out("first")
    for number in range(MOST - 1):
        attempts.left_out(str(number))
    assert attempts.left_out("first") is None
    for number in range(MOST):
        attempts.left_out(f"more {number}")
    assert len(attempts) == MOST
    assert attempts.left_out("first") == 0


@given(st.lists(st.floats(0, 3 * EVERY_S), max_size=200))
def test_none_is_lost_from_the_count_and_the_log_grows_slowly(pauses_s: list[float]) -> None:
    clock = Clock()
    attempts = Attempts(clock)
    told = waiting = 0
    for pause_s in pauses_s:
        clock.now_s += pause_s
        left_out = attempts.left_out("x")
        if left_out is None:
            waiting += 1
        else:
            assert left_out == waiting
            told, waiting = told + 1, 0
    assert told <= FREE + sum(pauses_s) / EVERY_S
