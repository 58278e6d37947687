"""What a slowed down processor excuses, and what not."""

from itertools import cycle

import pytest

from tests.support import slowdown
from tests.support.slowdown import Slowdown
from tests.support.undisturbed import DisturbedError

PROMISED = 0.01


def slowed_down(times: float, monkeypatch: pytest.MonkeyPatch) -> Slowdown:
    """Half of the work takes longer, so that all of it does so many times."""
    durations_s = cycle([1.0, 2 * times - 1])
    monkeypatch.setattr(slowdown, "_work_s", lambda: next(durations_s))
    made = Slowdown()
    made.sample()
    return made


@pytest.mark.parametrize(
    ("times", "counted", "figure"),
    [(1, 0.009, 0.009), (1, 0.012, 0.012), (1.25, 0.0125, 0.01), (1.5, 0.03, 0.02), (2, 0.0144, 0.0096)],
)
def test_a_figure_is_divided_by_the_slowdown_up_to_a_bound(
    monkeypatch: pytest.MonkeyPatch, times: float, counted: float, figure: float
) -> None:
    made = slowed_down(times, monkeypatch)
    assert made.factor == pytest.approx(times)
    assert made.at_full_speed(counted, PROMISED) == pytest.approx(figure)


def test_beyond_the_bound_nothing_is_excused_and_nothing_is_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DisturbedError, match=r"0\.0190 was counted, by a processor slowed down 2\.00 times"):
        slowed_down(2, monkeypatch).at_full_speed(0.019, PROMISED)
