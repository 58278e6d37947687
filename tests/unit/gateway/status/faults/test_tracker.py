"""The life of a fault, without a clock: every instant is given."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.status.fault import Condition, Fault, Severity
from gateway.status.faults.tracker import CAPPED, MOST_ACTIVE, MOST_CLEARED, FaultTracker

CLEAR_AFTER_S, KEEP_CLEARED_S = 2.0, 60.0


def condition(fault_id: str, severity: Severity = Severity.WARNING, message: str = "it hurts") -> Condition:
    return Condition(fault_id, severity, "robot", message, "look at it")


@pytest.fixture
def book() -> FaultTracker:
    return FaultTracker(CLEAR_AFTER_S, KEEP_CLEARED_S)


def ids(faults: tuple[Fault, ...]) -> list[str]:
    return [fault.condition.fault_id for fault in faults]


def test_a_condition_that_stays_is_one_fault_with_one_onset(book: FaultTracker) -> None:
    assert ids(book.update([condition("a")], 10.0).raised) == ["a"]
    assert book.update([condition("a")], 11.0).raised == ()
    (fault,) = book.faults
    assert (fault.onset_s, fault.seen_s, fault.active, fault.times_raised) == (10.0, 11.0, True, 1)


def test_a_fault_is_over_when_its_condition_stayed_away_long_enough(book: FaultTracker) -> None:
    book.update([condition("a")], 10.0)
    assert book.update([], 11.9).cleared == ()
    assert book.faults[0].active
    assert ids(book.update([], 12.0).cleared) == ["a"]
    (fault,) = book.faults
    assert (fault.active, fault.cleared_s) == (False, 12.0)


@pytest.mark.parametrize("clear_after_s", [CLEAR_AFTER_S, 0.0])
def test_a_condition_is_seen_at_the_newest_look_alone(clear_after_s: float) -> None:
    book = FaultTracker(clear_after_s, KEEP_CLEARED_S)

    def seen(severity: Severity | None, now_s: float) -> Severity | None:
        book.update([condition("a", severity)] if severity else [], now_s)
        return book.faults[0].seen_severity

    assert seen(Severity.ERROR, 10.0) is Severity.ERROR
    assert seen(Severity.WARNING, 11.0) is Severity.WARNING, "although the fault may be an error still"
    assert seen(None, 12.0) is None, "although the fault may be active still"
    assert seen(None, 15.0) is None
    assert seen(Severity.WARNING, 16.0) is Severity.WARNING


def test_what_comes_and_goes_quickly_is_one_fault(book: FaultTracker) -> None:
    for step in range(40):
        changes = book.update([condition("a")] if step % 2 else [], step * 0.9)
        assert len(changes.raised) == (step == 1)
        assert changes.cleared == ()


def test_a_fault_that_returns_counts_and_begins_anew(book: FaultTracker) -> None:
    book.update([condition("a")], 10.0)
    book.update([], 13.0)
    book.update([condition("a")], 20.0)
    (fault,) = book.faults
    assert (fault.onset_s, fault.times_raised, fault.active) == (20.0, 2, True)


def test_what_is_over_is_forgotten_in_time(book: FaultTracker) -> None:
    book.update([condition("a")], 10.0)
    book.update([], 13.0)
    book.update([], 13.0 + KEEP_CLEARED_S)
    assert ids(book.faults) == ["a"]
    book.update([], 13.1 + KEEP_CLEARED_S)
    assert book.faults == ()


def test_only_the_newest_that_are_over_are_remembered(book: FaultTracker) -> None:
    for number in range(MOST_CLEARED + 3):
        book.update([condition(f"f{number}")], 10.0 + number * 0.1)
    book.update([], 20.0)
    assert len(book.faults) == MOST_CLEARED


def test_the_newest_cleared_fault_comes_first(book: FaultTracker) -> None:
    book.update([condition("a"), condition("b")], 10.0)
    book.update([condition("a")], 13.0)
    book.update([], 16.0)
    assert ids(book.faults) == ["a", "b"]


def test_counts_are_kept_of_the_latest_ids_alone(book: FaultTracker) -> None:
    now_s = 0.0

    def raised(*names: str) -> int:
        """Raises and clears these faults; returns the count of the last one."""
        nonlocal now_s
        count = 0
        for name in names:
            now_s += 10.0
            (fault,) = book.update([condition(name)], now_s).raised
            count = fault.times_raised
            now_s += 10.0
            book.update([], now_s)
        return count

    assert raised("a", *(f"one {number}" for number in range(1000)), "a") == 2
    assert raised(*(f"two {number}" for number in range(1000)), "a") == 3, "raised again, it is the latest"
    assert raised(*(f"three {number}" for number in range(1024)), "a") == 1, "1024 others came since"


def test_getting_worse_is_reported_and_keeps_the_onset(book: FaultTracker) -> None:
    book.update([condition("a")], 10.0)
    changes = book.update([condition("a", Severity.ERROR, "it burns")], 11.0)
    assert ids(changes.worsened) == ["a"]
    assert (book.faults[0].onset_s, book.faults[0].condition.message) == (10.0, "it burns")
    assert book.update([condition("a")], 12.0).worsened == ()


def test_getting_better_has_to_last(book: FaultTracker) -> None:
    book.update([condition("a", Severity.ERROR, "it burns")], 10.0)
    for step in range(1, 40):
        severity = Severity.ERROR if step % 2 == 0 else Severity.WARNING
        assert book.update([condition("a", severity)], 10.0 + step).worsened == ()
        assert book.faults[0].condition.severity is Severity.ERROR
    book.update([condition("a")], 50.0)
    assert book.faults[0].condition.severity is Severity.WARNING
    assert ids(book.update([condition("a", Severity.ERROR)], 51.0).worsened) == ["a"]


def test_the_worst_comes_first_then_the_oldest(book: FaultTracker) -> None:
    book.update([condition("old")], 1.0)
    book.update([condition("old"), condition("new"), condition("bad", Severity.ERROR)], 2.0)
    assert ids(book.faults) == ["bad", "old", "new"]


def test_too_many_are_capped_and_it_says_so(book: FaultTracker) -> None:
    many = [condition(f"f{number:03}") for number in range(MOST_ACTIVE + 10)]
    book.update(many, 1.0)
    assert len(book.faults) == MOST_ACTIVE
    capped = next(fault for fault in book.faults if fault.condition.fault_id == CAPPED)
    assert capped.condition.message == "11 more faults are not listed"


def test_worse_takes_the_place_and_what_gave_way_is_not_called_over(book: FaultTracker) -> None:
    many = [condition(f"f{number:03}") for number in range(MOST_ACTIVE)]
    book.update(many, 1.0)
    changes = book.update([*many, condition("worst", Severity.ERROR)], 2.0)
    assert ids(changes.raised) == ["worst", CAPPED]
    assert changes.cleared == ()
    assert len([fault for fault in book.faults if fault.active]) == MOST_ACTIVE


def test_among_equals_the_listed_ones_stay(book: FaultTracker) -> None:
    listed = [condition(f"m{number:03}") for number in range(MOST_ACTIVE - 1)]
    book.update(listed, 1.0)
    changes = book.update([condition("a"), *listed, condition("z")], 2.0)
    assert ids(changes.raised) == [CAPPED]
    assert {each.fault_id for each in listed} < book.active_ids


STEPS = st.lists(
    st.tuples(
        # One number stands for many faults, so that short lists come to the caps, too.
        st.frozensets(st.integers(0, 6), max_size=6).map(
            lambda groups: frozenset(group * 10 + unit for group in groups for unit in range(10))
        ),
        st.integers(0, 70_000),
        st.sampled_from(Severity),
    ),
    max_size=12,
)


@given(steps=STEPS)
def test_whatever_happens_the_book_is_bounded_and_every_raised_fault_ends_once(
    steps: list[tuple[frozenset[int], int, Severity]],
) -> None:
    book, now_s = FaultTracker(CLEAR_AFTER_S, KEEP_CLEARED_S), 0.0
    seen: dict[str, float] = {}
    for present, pause_ms, severity in steps:
        now_s += pause_ms / 1000
        changes = book.update([condition(str(number), severity) for number in present], now_s)
        seen |= {str(number): now_s for number in present}
        active = {fault.condition.fault_id for fault in book.faults if fault.active}
        assert len(active) <= MOST_ACTIVE
        assert len(book.faults) - len(active) <= MOST_CLEARED
        assert len({fault.condition.fault_id for fault in book.faults}) == len(book.faults)
        for fault in changes.cleared:
            if fault.condition.fault_id != CAPPED:
                assert now_s - seen[fault.condition.fault_id] >= CLEAR_AFTER_S
        if len(present) <= MOST_ACTIVE and CAPPED not in active:
            assert {str(number) for number in present} <= active
