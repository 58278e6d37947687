"""When a connection has become too old."""

from console.receiver.age import AgeBound

FRAME_S = 1 / 30


def played(bound: AgeBound, delays_s: list[float], ages_known: bool = False) -> int | None:
    """Returns which frame exceeds the bound, of frames with these delays."""
    for number, delay_s in enumerate(delays_s):
        time_s = number * FRAME_S
        if bound.exceeded(1000 + time_s + delay_s, time_s, delay_s if ages_known else None):
            return number
    return None


def test_a_steady_delay_is_no_age() -> None:
    assert played(AgeBound(1.0), [5.0] * 100) is None


def test_growing_age_is_noticed_without_a_clock() -> None:
    delays_s = [0.02 * number for number in range(100)]
    assert played(AgeBound(1.0), delays_s) == 51


def test_growing_age_is_noticed_with_a_clock() -> None:
    delays_s = [0.3 + 0.02 * number for number in range(100)]
    assert played(AgeBound(1.0), delays_s, ages_known=True) == 36


def test_age_from_the_beginning_is_not_helped_by_a_new_connection() -> None:
    assert played(AgeBound(1.0), [3.0] * 100, ages_known=True) is None


def test_a_short_hold_is_no_reason() -> None:
    assert played(AgeBound(1.0), [0.02] * 20 + [0.7, 0.6, 0.5] + [0.02] * 20) is None


def test_a_day_of_drifting_clocks_is_no_age() -> None:
    bound = AgeBound(1.0)
    for second in range(0, 86_400, 10):
        assert not bound.exceeded(second * 1.0002, second, None)


def test_another_clock_of_the_sender_is_no_age() -> None:
    bound = AgeBound(1.0)
    assert not bound.exceeded(10.0, 10.0, None)
    assert not bound.exceeded(10.1, 5000.0, None)
    assert not bound.exceeded(10.2, 1.0, None)
