"""Totals over the processes of the preview service."""

from hypothesis import given
from hypothesis import strategies as st

from gateway.links.preview.counters import CounterTotals
from gateway.status.preview import Counters

STEPS = st.lists(
    st.tuples(st.booleans(), st.integers(0, 3), st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=30
)


@given(steps=STEPS, repeats=st.integers(1, 3))
def test_totals_are_the_sum_over_processes_however_often_each_reports(
    steps: list[tuple[bool, int, int, int]], repeats: int
) -> None:
    """Each step may begin a new process, and adds to what the current one counted."""
    totals, expected, instance, counted = CounterTotals(), Counters(), 0, Counters()
    totals.take("0", counted)
    for begins_again, starts, faults, fallbacks in steps:
        if begins_again:
            instance, counted = instance + 1, Counters()
        counted = Counters(counted.starts + starts, 0, counted.faults + faults, counted.fallbacks + fallbacks)
        expected = Counters(
            expected.starts + starts, 0, expected.faults + faults, expected.fallbacks + fallbacks
        )
        for _ in range(repeats):
            totals.take(str(instance), counted)
        assert totals.total == expected


def test_counts_of_the_first_process_before_the_gateway_started_are_left_out() -> None:
    totals = CounterTotals()
    totals.take("old", Counters(starts=7, faults=2))
    assert totals.total == Counters()
    totals.take("old", Counters(starts=8, faults=2))
    assert totals.total == Counters(starts=1)


def test_the_first_start_of_a_process_that_continues_counts_as_a_restart_once() -> None:
    totals = CounterTotals()
    totals.take("a", Counters())
    totals.take("a", Counters(starts=1))
    totals.next_start_is_restart()
    totals.take("b", Counters())
    assert totals.total == Counters(starts=1)
    totals.take("b", Counters(starts=1))
    totals.take("b", Counters(starts=2))
    assert totals.total == Counters(starts=3, restarts=1)


def test_counts_never_shrink() -> None:
    totals = CounterTotals()
    totals.take("a", Counters())
    totals.take("a", Counters(starts=5))
    totals.take("a", Counters(starts=2))
    assert totals.total.starts == 5
