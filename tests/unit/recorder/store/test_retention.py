"""What goes first, and what never goes."""

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from recorder.store.retention import Keepable, Stored, frees, in_order

keepables = st.lists(
    st.builds(
        Keepable,
        name=st.uuids().map(str),
        ended_ns=st.integers(0, 100),
        ring=st.booleans(),
        open=st.booleans(),
        pinned=st.booleans(),
        to_copy=st.booleans(),
        copied=st.booleans(),
    ),
    unique_by=lambda each: each.name,
    max_size=30,
)


@given(keepables)
def test_what_is_open_pinned_or_still_to_be_copied_never_goes(candidates: list[Keepable]) -> None:
    for each in in_order(candidates):
        assert not any((each.open, each.pinned, each.to_copy))


@given(keepables, st.integers(0, 40))
def test_there_is_room_whenever_something_may_go(candidates: list[Keepable], needed: int) -> None:
    """Each takes a unit of room; deleting in order makes enough, or nothing that may go is left."""
    left, freed = list(candidates), 0
    for each in in_order(candidates):
        if freed >= needed:
            break
        left.remove(each)
        freed += 1
    assert freed >= needed or not any(not (each.open or each.pinned or each.to_copy) for each in left)
    assert freed <= needed


@given(keepables)
def test_copies_first_then_the_oldest_then_the_ring(candidates: list[Keepable]) -> None:
    order = in_order(candidates)
    groups = [2 if each.ring else 0 if each.copied else 1 for each in order]
    assert groups == sorted(groups)
    for group in range(3):
        ages = [each.ended_ns for each, its in zip(order, groups, strict=True) if its == group]
        assert ages == sorted(ages)


def stored(number: int, links: int = 1, size: int = 10) -> Stored:
    return Stored((1, number), links, size)


def recording(name: str, *files: Stored, ordinal: int = 0, ended_ns: int = 0) -> Keepable:
    return Keepable(name, ended_ns, ordinal=ordinal, files=files)


def freed(*order: Keepable) -> list[tuple[str, int]]:
    return [(each.name, size) for each, size in frees(order)]


def test_a_file_is_freed_with_its_last_name() -> None:
    shared = stored(1, links=2)
    assert freed(recording("a", shared, stored(2)), recording("b", shared)) == [("a", 10), ("b", 10)]


def test_what_shares_everything_with_something_that_stays_is_left_out() -> None:
    backed_up = stored(1, links=2)
    assert freed(recording("a", backed_up), recording("b", stored(2)), recording("c")) == [("b", 10)]
    assert freed(recording("a", backed_up, stored(3))) == [("a", 10)]


def segment(name: str, file: Stored, ended_ns: int = 0) -> Keepable:
    return Keepable(name, ended_ns, ring=True, files=(file,))


def test_what_frees_nothing_without_the_ring_goes_after_the_ring() -> None:
    """The defect: it went before the ring, freed nothing, and the ring dropped the last name of its files."""
    shared, also_shared, backed_up = stored(1, links=2), stored(2, links=2), stored(3, links=2)
    incident = recording("incident", shared, backed_up)
    partly = recording("partly", stored(4), also_shared)
    ring = [segment("old", shared), segment("middle", also_shared, 1), segment("new", stored(5), 2)]
    order = in_order([incident, partly, *ring])
    assert freed(*order) == [("partly", 10), ("old", 0), ("middle", 10), ("new", 10), ("incident", 10)]


def test_a_copy_that_shares_everything_with_the_ring_goes_after_the_ring() -> None:
    shared = stored(1, links=3)
    copied = replace(recording("copied", shared), copied=True)
    order = in_order([copied, recording("other", shared), segment("ring", shared)])
    assert freed(*order) == [("ring", 0), ("copied", 0), ("other", 10)]


def test_the_order_of_making_counts_and_not_the_calendar() -> None:
    """A robot without a clock of its own begins in 1970 after each start."""
    newest = recording("newest", ordinal=2, ended_ns=5)
    before = recording("before", ordinal=1, ended_ns=2_000_000_000)
    of_a_former_release = recording("former", ended_ns=1_900_000_000)
    assert in_order([newest, before, of_a_former_release]) == [of_a_former_release, before, newest]
