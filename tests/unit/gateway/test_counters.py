from hypothesis import given
from hypothesis import strategies as st

from gateway.preview_link.counters import Ledger
from gateway.status.preview import Counters

STEPS = st.lists(
    st.tuples(st.booleans(), st.integers(0, 3), st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=30
)


@given(steps=STEPS, repeats=st.integers(1, 3))
def test_what_every_process_counted_adds_up_however_often_it_is_told(
    steps: list[tuple[bool, int, int, int]], repeats: int
) -> None:
    """Each step may begin a new process, and adds to what the current one counted."""
    ledger, expected, instance, told = Ledger(), Counters(), 0, Counters()
    ledger.heard("0", told)
    for begins_again, starts, faults, fallbacks in steps:
        if begins_again:
            instance, told = instance + 1, Counters()
        told = Counters(told.starts + starts, 0, told.faults + faults, told.fallbacks + fallbacks)
        expected = Counters(
            expected.starts + starts, 0, expected.faults + faults, expected.fallbacks + fallbacks
        )
        for _ in range(repeats):
            ledger.heard(str(instance), told)
        assert ledger.total == expected


def test_what_the_first_process_counted_before_the_gateway_came_is_not_ours() -> None:
    ledger = Ledger()
    ledger.heard("old", Counters(starts=7, faults=2))
    assert ledger.total == Counters()
    ledger.heard("old", Counters(starts=8, faults=2))
    assert ledger.total == Counters(starts=1)


def test_the_first_start_of_a_process_that_continues_counts_as_a_restart_once() -> None:
    ledger = Ledger()
    ledger.heard("a", Counters())
    ledger.heard("a", Counters(starts=1))
    ledger.next_start_is_restart()
    ledger.heard("b", Counters())
    assert ledger.total == Counters(starts=1)
    ledger.heard("b", Counters(starts=1))
    ledger.heard("b", Counters(starts=2))
    assert ledger.total == Counters(starts=3, restarts=1)


def test_counts_never_shrink() -> None:
    ledger = Ledger()
    ledger.heard("a", Counters())
    ledger.heard("a", Counters(starts=5))
    ledger.heard("a", Counters(starts=2))
    assert ledger.total.starts == 5
