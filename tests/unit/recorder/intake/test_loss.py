"""Counting what is missing by numbers, with nothing but numbers to go by."""

from collections.abc import Hashable, Sequence
from itertools import count
from random import Random
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recorder.intake import loss
from recorder.intake.loss import Kind, LossCounter


def lost(counter: LossCounter, publishers: frozenset[Hashable] | None) -> int:
    found = counter.collect(publishers)
    return (found.messages or 0) if found else 0


ONE: frozenset[Hashable] = frozenset({"a"})


@pytest.fixture
def counter() -> LossCounter:
    counter = LossCounter()
    counter.collect(ONE)
    return counter


def take(counter: LossCounter, numbers: Sequence[int]) -> None:
    for number in numbers:
        counter.take(number, at_ns=number * 10)


def another_takes_its_place(counter: LossCounter) -> None:
    """Nothing is missing when it does, and its own restart is noticed."""
    assert counter.collect(frozenset({"b"})) is None
    take(counter, [1, 2])
    assert counter.collect(frozenset({"b"})) is None
    take(counter, [3, 1])
    found = counter.collect(frozenset({"b"}))
    assert found, "this one was started again unnoticed"
    assert found.messages is None


def test_a_gap_is_counted_once_with_the_times_around_it(counter: LossCounter) -> None:
    take(counter, [5, 6, 9, 10])
    found = counter.collect(ONE)
    assert found
    assert (found.messages, found.began_ns, found.ended_ns) == (2, 60, 90)
    assert counter.collect(ONE) is None


def test_what_came_before_the_first_message_is_not_lost(counter: LossCounter) -> None:
    take(counter, [1000, 1001])
    assert lost(counter, ONE) == 0


def test_a_message_that_comes_late_is_not_lost(counter: LossCounter) -> None:
    take(counter, [1, 2, 5, 4, 6, 3])
    assert lost(counter, ONE) == 0


def test_a_message_that_comes_late_is_not_lost_whatever_the_clock_of_its_publisher(
    counter: LossCounter,
) -> None:
    """The defect: it had to lie between the source times around the gap, or was a restart."""
    for number, published_ns in [(1, 10), (2, 20), (4, 40), (3, 5)]:
        counter.take(number, number, published_ns)
    assert counter.collect(ONE) is None


def test_a_message_that_comes_twice_changes_nothing(counter: LossCounter) -> None:
    """As the newest of a transient local publisher does, when the subscription is replaced."""
    for number, published_ns in [(1, 7), (2, 8), (2, 8), (3, 9)]:
        counter.take(number, number, published_ns)
    assert counter.collect(ONE) is None


@pytest.mark.parametrize("published_ns", [9, -1], ids=["another", "unknown"])
def test_the_same_number_of_another_message_is_a_restart(counter: LossCounter, published_ns: int) -> None:
    counter.take(1, 1, 8 if published_ns > 0 else -1)
    counter.take(1, 2, published_ns)
    found = counter.collect(ONE)
    assert found
    assert found.messages is None


def test_a_publisher_that_has_taken_the_place_of_another_is_no_gap(counter: LossCounter) -> None:
    """The defect: it was one unless its first message came before the graph was examined."""
    take(counter, [97, 98, 99])
    assert counter.collect(ONE) is None
    another_takes_its_place(counter)


def test_a_publisher_that_was_there_beside_the_one_whose_place_it_takes_is_no_gap(
    counter: LossCounter,
) -> None:
    """The defect: the newest message was taken for its own, and its next one for a restart."""
    take(counter, [97, 98])
    assert counter.collect(ONE) is None
    for at, number in enumerate([99, 1, 100], 1000):
        counter.take(number, at)
    assert counter.collect(frozenset({"b"})) is None
    for at, number in enumerate([2, 3], 2000):
        counter.take(number, at)
    assert counter.collect(frozenset({"b"})) is None
    counter.take(5, 3000)
    assert lost(counter, frozenset({"b"})) == 1


@pytest.mark.parametrize(("former", "until"), [(5, 10), (300, 900)])
def test_a_publisher_that_passes_where_the_one_whose_place_it_takes_had_come_is_no_gap(
    counter: LossCounter, former: int, until: int
) -> None:
    """The defect: what it sent from there on was taken for the former one's, and forgotten with it."""
    take(counter, range(1, former + 1))
    assert counter.collect(ONE) is None
    for number in range(1, until + 1):
        counter.take(number, 10 * former + number)
    assert counter.collect(frozenset({"b"})) is None
    counter.take(until + 1, 10 * former + until + 1)
    assert counter.collect(frozenset({"b"})) is None
    counter.take(until + 3, 10 * former + until + 3)
    assert lost(counter, frozenset({"b"})) == 1


def test_a_publisher_that_was_heard_once_before_another_took_its_place_is_no_gap(
    counter: LossCounter,
) -> None:
    take(counter, [49, 50])
    another_takes_its_place(counter)


def test_a_message_that_fits_the_publisher_and_the_one_in_its_place_makes_no_restart(
    counter: LossCounter,
) -> None:
    """The defect: it was taken for the latter's, and the latter's own one for a restart."""
    take(counter, [1])
    assert counter.collect(ONE) is None
    for at, number in enumerate([1, 2, 3], 1000):  # the first is of b, the others of a
        counter.take(number, at)
    assert counter.collect(frozenset({"b"})) is None
    counter.take(2, 2000)
    assert counter.collect(frozenset({"b"})) is None


def test_what_a_publisher_sends_while_it_is_level_with_the_one_whose_place_it_takes_is_its_own(
    counter: LossCounter,
) -> None:
    """The defect: it was taken for the former one's, and forgotten with it."""
    take(counter, range(1, 6))
    assert counter.collect(ONE) is None
    for at, number in enumerate([1, 2, 3, 4, 5, 6, 6, 7], 1000):  # one of the sixth is of a
        counter.take(number, at)
    assert counter.collect(frozenset({"b"})) is None
    counter.take(8, 2000)
    assert counter.collect(frozenset({"b"})) is None


def test_two_publishers_of_which_one_leaves_before_the_graph_is_examined_are_no_gap() -> None:
    counter = LossCounter()
    counter.collect(ONE)
    for at, number in enumerate([1, 1, 2]):
        counter.take(number, at, published_ns=at + 1)
    assert counter.collect(frozenset({"b"})) is None
    for at, number in enumerate([2, 3], 10):
        counter.take(number, at, published_ns=at + 1)
    assert counter.collect(frozenset({"b"})) is None


def test_a_publisher_that_is_back_is_no_gap(counter: LossCounter) -> None:
    take(counter, [97, 98, 99])
    for publishers in (ONE, frozenset[Hashable](), frozenset({"b"})):
        assert counter.collect(publishers) is None
    take(counter, [1, 2])
    assert counter.collect(frozenset({"b"})) is None


def test_a_publisher_that_was_never_heard_is_no_gap_when_the_other_leaves(counter: LossCounter) -> None:
    take(counter, [97, 98, 99])
    assert counter.collect(frozenset({"a", "b"})) is None
    assert counter.collect(frozenset({"b"})) is None
    take(counter, [1, 2])
    assert counter.collect(frozenset({"b"})) is None


def test_a_restarted_publisher_has_lost_nothing(counter: LossCounter) -> None:
    for at, number in enumerate([*range(1, 101), *range(1, 51)]):
        counter.take(number, at)
    assert counter.collect(frozenset({"b"})) is None
    take(counter, [51, 53])
    assert lost(counter, frozenset({"b"})) == 1


def test_a_publisher_that_joins_has_lost_nothing(counter: LossCounter) -> None:
    take(counter, [1, 2, 700, 3, 701])
    assert lost(counter, frozenset({"a", "b"})) == 0
    take(counter, [4, 702, 5, 703])
    assert lost(counter, frozenset({"a", "b"})) == 0
    take(counter, [4 + 10, 704 + 10])
    assert lost(counter, frozenset({"a", "b"})) == 8 + 10


@pytest.mark.parametrize("publishers", [ONE, None], ids=["the same", "unknown"])
def test_a_restart_that_the_graph_does_not_show_is_a_gap_of_unknown_size(
    counter: LossCounter, publishers: frozenset[Hashable] | None
) -> None:
    """How far the former publisher had come is in no number."""
    for at, number in enumerate([98, 99, 1, 2]):
        counter.take(number, at)
    found = counter.collect(publishers)
    assert found
    assert (found.messages, found.began_ns, found.ended_ns) == (None, 1, 2)
    take(counter, [3, 5])
    assert lost(counter, ONE) == 1


def test_a_number_that_starts_again_after_its_greatest_is_a_restart(counter: LossCounter) -> None:
    take(counter, [2**63 - 2, 2**63 - 1, 1, 2])
    found = counter.collect(ONE)
    assert found
    assert found.messages is None


def test_a_sequence_of_one_that_has_gone_is_remembered_as_such_when_others_join() -> None:
    """The defect: the first message of one of them was a restart."""
    counter = LossCounter()
    counter.collect(ONE)
    counter.take(3, 1)
    assert counter.collect(frozenset({"b"})) is None
    assert counter.collect(frozenset({"b", "c"})) is None
    counter.take(1, 2, published_ns=2)
    counter.take(1, 3, published_ns=3)
    assert counter.collect(frozenset({"b", "c"})) is None


def test_a_publisher_that_leaves_others_is_no_gap(counter: LossCounter) -> None:
    """Its number was the newest: the one of those that stay is taken for it, and found again."""
    counter.collect(frozenset({"a", "b"}))
    for at, number in enumerate([1, 700, 2, 701]):
        counter.take(number, at)
    assert counter.collect(frozenset({"a", "b"})) is None
    assert counter.collect(ONE) is None
    for at, number in enumerate([3, 4, 5], 10):
        counter.take(number, at)
    assert counter.collect(ONE) is None


@pytest.mark.parametrize("graph", [frozenset({"a", "b"}), ONE], ids=["the same", "one has gone"])
def test_one_that_is_missing_of_those_that_may_be_history_is_one(graph: frozenset[Hashable]) -> None:
    """The defect: all that the publisher with the lower numbers sent from there on counted as missing."""
    counter = LossCounter()
    counter.collect(frozenset({"a", "b"}))
    counter.take(700, 0, published_ns=1_000)
    counter.take(6, 1, published_ns=106)
    for number in range(8, 20):
        counter.take(number, number, published_ns=100 + number, kind=Kind.MAYBE_HISTORY)
        assert counter.collect(frozenset({"a", "b"})) is None, "not known yet whether it is history"
    counter.take(20, 20, published_ns=120)
    found = counter.collect(graph)
    assert found
    assert (found.messages, found.began_ns, found.ended_ns) == (1, 1, 8)
    counter.take(22, 22, published_ns=122)
    assert lost(counter, graph) == 1


@pytest.mark.parametrize("first", [True, False], ids=["before", "after"])
def test_what_came_by_another_way_is_neither_missing_nor_the_newest(
    counter: LossCounter, first: bool
) -> None:
    take(counter, [1])
    for number, aside in [(2, True), (4, False)] if first else [(4, False), (2, True)]:
        counter.take(number, number * 10, kind=Kind.ASIDE if aside else Kind.LIVE)
    for number in (5, 6):
        counter.take(number, number * 10, kind=Kind.ASIDE)
    counter.take(5, 50)
    found = counter.collect(ONE)
    assert found
    assert (found.messages, found.ended_ns) == (1, 40)


def test_history_of_one_publisher_finds_nothing_of_what_another_lacks() -> None:
    counter = LossCounter()
    counter.collect(frozenset({"a", "b"}))
    counter.take(700, 0, published_ns=1_000)
    counter.take(600, 1, published_ns=5_000)
    for number in range(605, 651):
        counter.take(number, number, published_ns=300 + number, kind=Kind.MAYBE_HISTORY)
    counter.take(611, 1_000, published_ns=6_000)
    for number in (605, 606):
        counter.take(number, 1_001, published_ns=300 + number, kind=Kind.MAYBE_HISTORY)
    assert lost(counter, frozenset({"a", "b"})) == 10


def test_what_may_be_history_is_kept_in_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loss, "_MAX_ASIDE", 10)
    counter = LossCounter()
    counter.collect(frozenset({"a", "b"}))
    counter.take(700, 0, published_ns=1_000)
    counter.take(6, 1, published_ns=106)
    for number in range(8, 28):
        counter.take(number, number, published_ns=100 + number, kind=Kind.MAYBE_HISTORY)
    counter.take(28, 28, published_ns=128)
    assert lost(counter, frozenset({"a", "b"})) == 11, "those that were forgotten, too"


@pytest.mark.parametrize("publishers", [20, 256])
def test_the_work_for_what_may_be_history_is_kept_in_bounds(
    monkeypatch: pytest.MonkeyPatch, publishers: int
) -> None:
    """The defect: each of these messages was compared with each of the sequences, for every gap."""
    compare, compared = loss._may_follow, 0

    def may_follow(*each: Any) -> bool:
        nonlocal compared
        compared += 1
        return compare(*each)

    monkeypatch.setattr(loss, "_may_follow", may_follow)
    counter = LossCounter()
    graph: frozenset[Hashable] = frozenset(range(publishers))
    counter.collect(graph)
    for beginning in range(publishers):
        counter.take(10 + beginning * 1_000, 0, published_ns=1)
    for number in range(100):
        counter.take(20 + number, number, published_ns=2, kind=Kind.ASIDE)
    counter.take(publishers * 1_000, 1_000, published_ns=3)
    assert counter.collect(graph)
    assert compared <= 2 * 20 * 100


def test_where_messages_have_no_numbers_nothing_is_counted(counter: LossCounter) -> None:
    take(counter, [0, 0, 0])
    assert lost(counter, ONE) == 0


def test_without_knowledge_of_the_publishers_nothing_is_counted(counter: LossCounter) -> None:
    take(counter, [1, 5])
    assert lost(counter, None) == 0


def test_without_knowledge_of_the_publishers_it_is_unknown_how_many_are_missing(counter: LossCounter) -> None:
    take(counter, [1, 2, 5])
    found = counter.collect(None)
    assert found
    assert (found.messages, found.began_ns, found.ended_ns) == (None, 20, 50)
    take(counter, [6, 7])
    assert counter.collect(None) is None
    take(counter, [9])
    assert lost(counter, ONE) == 1, "the publishers that were known before are there"


def test_what_is_missing_while_a_publisher_joins_or_leaves_is_counted(counter: LossCounter) -> None:
    take(counter, [1, 2, 700, 4, 702])
    assert lost(counter, frozenset({"a", "b"})) == 2
    take(counter, [5, 703, 7, 8])
    assert lost(counter, ONE) == 1
    take(counter, [9, 11])
    assert lost(counter, ONE) == 1


def test_more_than_can_be_gone_through_again_is_unknown(
    counter: LossCounter, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loss, "_MAX_RECENT", 10)
    take(counter, [*range(1, 20), 21])
    found = counter.collect(frozenset({"b"}))
    assert found
    assert found.messages is None


def test_memory_is_bounded_and_the_count_exact(counter: LossCounter) -> None:
    take(counter, range(1, 200_001, 2))
    assert lost(counter, ONE) == 99_999


def counted_and_lost(
    beginnings: Sequence[int], dropped: Sequence[bool], order: Random, *, exact: bool = False
) -> tuple[int, int]:
    """Lets as many publishers send in any order; the first and the last message of each arrives."""
    publishers: frozenset[Hashable] = frozenset(range(len(beginnings)))
    counter = LossCounter()
    counter.collect(publishers)
    newest = list(beginnings)
    for number in beginnings:
        counter.take(number, 0)
    for at, drop in enumerate(dropped, 1):
        chosen = order.randrange(len(newest))
        newest[chosen] += 1
        if not drop:
            counter.take(newest[chosen], at)
    for number in newest:
        counter.take(number + 1, 10_000)
    found = counter.collect(publishers)
    assert not (exact and found), "not even a gap of unknown size"
    return (found.messages or 0) if found else 0, sum(dropped)


DROPPED = st.lists(st.booleans(), max_size=200)
ORDER = st.randoms(use_true_random=False)


@given(
    steps=st.lists(st.sampled_from(["send", "send", "send", "send", "join", "leave", "look"]), max_size=60),
    order=ORDER,
    beginning=st.integers(1, 400),
)
def test_where_publishers_come_and_go_and_nothing_was_lost_nothing_is_counted(
    steps: list[str], order: Random, beginning: int
) -> None:
    """The newest messages of one that leaves may come when the graph shows no longer that it was there."""
    counter = LossCounter()
    there = {0: beginning}
    leaving: dict[int, int] = {}
    names, clock = count(1), count(1)

    def send(number: int) -> None:
        counter.take(number, at := next(clock), at)

    def look() -> None:
        assert counter.collect(frozenset(there)) is None
        for number in leaving.values():
            for each in range(order.randrange(3)):
                send(number + each)
        leaving.clear()

    look()
    seen = set(there)
    for step in steps:
        if step == "join" and len(there) < 4:
            there[next(names)] = 1
        elif step == "leave" and there and (chosen := order.choice(sorted(there))) in seen:
            leaving[chosen] = there.pop(chosen)
        elif step == "look":
            look()
            seen |= set(there)
        elif there:
            chosen = order.choice(sorted(there))
            send(there[chosen])
            there[chosen] += 1
    look()


@given(lost=st.lists(st.booleans(), min_size=1, max_size=30), before=st.integers(1, 5), order=ORDER)
def test_what_is_lost_of_those_that_stay_is_counted_once_they_were_heard(
    lost: list[bool], before: int, order: Random
) -> None:
    counter = LossCounter()
    counter.collect(frozenset({"a", "b", "gone"}))
    newest = {"a": 10, "b": 1_000, "gone": 500}
    at = 0

    def send(publisher: str) -> None:
        nonlocal at
        at += 1
        newest[publisher] += 1
        counter.take(newest[publisher], at, at)

    for publisher in [*newest] * before:
        send(publisher)
    there: frozenset[Hashable] = frozenset({"a", "b"})
    assert counter.collect(there) is None
    send("gone")
    for _ in range(2):
        assert counter.collect(there) is None
        for publisher in ("a", "b"):
            send(publisher)
    assert counter.collect(there) is None
    for each in lost:
        publisher = order.choice(["a", "b"])
        if each:
            newest[publisher] += 1
        else:
            send(publisher)
    for publisher in ("a", "b"):
        send(publisher)
    found = counter.collect(there)
    assert (found.messages if found else 0) == sum(lost)
    newest["a"] = 0
    send("a")
    found = counter.collect(there)
    assert found, "started again unnoticed"
    assert found.messages is None


def test_what_a_publisher_lost_while_the_graph_did_not_show_it_is_counted(counter: LossCounter) -> None:
    """As where the network was cut for longer than the lease: it is the same one that is back."""
    both: frozenset[Hashable] = frozenset({"a", "b"})
    counter.collect(both)
    take(counter, [1, 700, 2, 701])
    for publishers in (both, ONE, ONE, both):
        assert counter.collect(publishers) is None
    take(counter, [3, 901])
    assert lost(counter, both) == 199


def test_restarts_beside_a_publisher_that_never_sends_are_no_gaps() -> None:
    """The defect: later each was one, because publishers that were forgotten left their sequences behind."""
    counter = LossCounter()
    counter.collect(frozenset({"silent"}))
    ats = count(1)
    for run in range(40):
        there: frozenset[Hashable] = frozenset({"silent", run})
        assert counter.collect(there) is None
        for number in range(1, 6):
            counter.take(number, at := next(ats), at)
        assert counter.collect(there) is None


@pytest.mark.parametrize("silent_at", [700, 50])
def test_a_publisher_that_left_without_a_message_changes_no_count(silent_at: int) -> None:
    """The defect: it was waited for, and what another one lost was taken for its first message."""
    both: frozenset[Hashable] = frozenset({"a", "silent"})
    counter = LossCounter()
    counter.collect(both)
    take(counter, [100, silent_at])
    for graph, number in [(both, 101), (both | {"b"}, 102), (both | {"b"}, 103), (both, 104)]:
        assert counter.collect(graph) is None
        take(counter, [number])
    assert counter.collect(both) is None
    take(counter, [105, 107, 108])
    assert lost(counter, both) == 1
    take(counter, [109, silent_at + 1])
    assert counter.collect(both) is None


def test_a_first_message_that_comes_after_its_publisher_left_is_no_gap() -> None:
    both: frozenset[Hashable] = frozenset({"a", "silent"})
    counter = LossCounter()
    counter.collect(both)
    take(counter, [100, 700])
    for graph, number in [(both, 101), (both | {"b"}, 102), (both, 1)]:
        assert counter.collect(graph) is None
        take(counter, [number])
    for number in (103, 701):
        assert counter.collect(both) is None
        take(counter, [number])
    assert counter.collect(both) is None


def test_what_has_gone_is_kept_in_bounds(counter: LossCounter) -> None:
    """Beside one that is silent, so that not all were heard."""
    counter.collect(frozenset({"silent", 0}))
    counter.take(10_000, 0, 1)
    for at in range(1, 400):
        counter.take(3, at, at + 1)
        assert counter.collect(frozenset({"silent", at})) is None
    assert len(counter._sequences) <= 2 + loss._MAX_GONE
    assert counter._expected <= 2 + loss._MAX_GONE


@given(dropped=DROPPED, apart=st.permutations([1, 1_000, 20_000]), count=st.integers(1, 3), order=ORDER)
def test_taken_and_lost_are_what_was_published(
    dropped: list[bool], apart: list[int], count: int, order: Random
) -> None:
    counted, missing = counted_and_lost(apart[:count], dropped, order)
    assert counted == missing


@given(
    messages=st.lists(st.tuples(st.integers(1, 4), st.integers(1, 3)), min_size=3, max_size=20),
    publishers=st.integers(1, 3),
    looks=st.sets(st.integers(0, 19)),
)
def test_the_short_way_of_the_usual_message_leads_to_the_same(
    messages: list[tuple[int, int]], publishers: int, looks: set[int]
) -> None:
    graph: frozenset[Hashable] = frozenset(range(publishers))

    def found(counter: LossCounter) -> list[Any]:
        counter.collect(graph)
        seen: list[Any] = []
        for at, (number, published_ns) in enumerate(messages):
            counter.take(number, at, published_ns)
            if at in looks:
                seen.append(counter.collect(graph))
        return [*seen, counter.collect(graph), counter._sequences]

    long_way = LossCounter()
    with patch.object(long_way, "_followed_by", lambda _: None):
        assert found(LossCounter()) == found(long_way)


@given(sent=st.integers(0, 200), beginnings=st.lists(st.integers(1, 20), min_size=1, max_size=4), order=ORDER)
def test_where_nothing_was_lost_nothing_is_counted(sent: int, beginnings: list[int], order: Random) -> None:
    assert counted_and_lost(beginnings, [False] * sent, order, exact=True) == (0, 0)
