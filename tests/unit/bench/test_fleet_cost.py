"""What the fleet's cost is worked out from: a load that was there, and what a robot adds."""

import pytest

from bench.fleet.cost import WINDOW_S, Cost, added_kib, check_load


def of(mib: float) -> Cost:
    return Cost(cpu_percent=1.0, mib=mib, state_us=100.0, event_bytes=250.0)


def test_what_the_server_takes_for_itself_is_no_robots() -> None:
    """The defect: it was divided by the robots, and counted ten times as much for each of ten times fewer."""
    ten, hundred, thousand = 20.0 + 10 / 16, 20.0 + 100 / 16, 20.0 + 1000 / 16
    assert added_kib([of(thousand)], [of(hundred)], 900) == [pytest.approx(64.0)]
    assert added_kib([of(hundred)], [of(ten)], 90) == [pytest.approx(64.0)]


@pytest.mark.parametrize("part", [0.84, 1.16, 0.0])
def test_a_load_that_was_not_there_has_no_figures(part: float) -> None:
    """The defect: on a busy machine fewer states were sent, and published as 1000 a second."""
    with pytest.raises(RuntimeError, match="would mean nothing"):
        check_load(round(1000 * WINDOW_S * part), 1000.0)


@pytest.mark.parametrize("part", [0.86, 1.0, 1.14])
def test_a_load_that_is_about_right_has(part: float) -> None:
    check_load(round(1000 * WINDOW_S * part), 1000.0)
