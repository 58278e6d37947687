"""The order of packets, under any order of arrival, loss and duplication."""

from dataclasses import dataclass, field

from hypothesis import given
from hypothesis import strategies as st

from console.receiver.reorder import Delivered, Reorder

WAIT_S = 0.25
LAST = (1 << 31) - 1


def contents(delivered: list[Delivered]) -> list[tuple[int, bytes]]:
    return [(each.missing, each.payload) for each in delivered]


def test_packets_in_order_pass_at_once() -> None:
    reorder = Reorder(7, WAIT_S)
    for number in (7, 8, 9):
        assert contents(reorder.put(number, b"%d" % number, 0.0)) == [(0, b"%d" % number)]
    assert reorder.deadline_s is None


def test_what_follows_a_gap_waits_for_it() -> None:
    reorder = Reorder(0, WAIT_S)
    assert reorder.put(1, b"1", 10.0) == []
    assert reorder.put(2, b"2", 10.1) == []
    assert (reorder.held, reorder.deadline_s) == (2, 10.0 + WAIT_S)
    assert contents(reorder.put(0, b"0", 10.2)) == [(0, b"0"), (0, b"1"), (0, b"2")]
    assert (reorder.held, reorder.given_up) == (0, 0)


def test_a_gap_is_given_up_in_time_and_counted() -> None:
    reorder = Reorder(0, WAIT_S)
    reorder.put(3, b"3", 10.0)
    assert reorder.expire(10.0 + WAIT_S - 0.001) == []
    assert contents(reorder.expire(10.0 + WAIT_S)) == [(3, b"3")]
    assert reorder.given_up == 3
    assert reorder.put(1, b"1", 11.0) == []
    assert reorder.dropped == 1


def test_the_numbers_wrap() -> None:
    reorder = Reorder(LAST, WAIT_S)
    assert reorder.put(1, b"c", 0.0) == []
    assert reorder.put(0, b"b", 0.0) == []
    assert contents(reorder.put(LAST, b"a", 0.0)) == [(0, b"a"), (0, b"b"), (0, b"c")]


def test_a_full_buffer_gives_up_the_first_gap() -> None:
    reorder = Reorder(0, WAIT_S, capacity=2)
    assert reorder.put(1, b"1", 0.0) == []
    assert reorder.put(4, b"4", 0.0) == []
    assert contents(reorder.put(5, b"5", 0.0)) == [(1, b"1")]
    assert (reorder.held, reorder.given_up) == (2, 1)


def test_a_longer_round_trip_takes_effect_at_once() -> None:
    reorder = Reorder(0, WAIT_S)
    reorder.put(1, b"1", 0.0)
    reorder.wait_s = 0.5
    assert reorder.expire(0.4) == []
    assert contents(reorder.expire(0.5)) == [(1, b"1")]


@dataclass
class Arrival:
    """A packet on its way: how far behind its place it comes, how often, and when after the one before."""

    delay: int
    copies: int
    pause_s: float


@dataclass
class Played:
    """What came out of a sequence of arrivals."""

    numbers: list[int] = field(default_factory=list)
    waits_s: list[float] = field(default_factory=list)
    missing: int = 0


arrivals = st.lists(
    st.builds(
        Arrival,
        delay=st.integers(0, 12),
        copies=st.sampled_from([0, 1, 1, 1, 2]),
        pause_s=st.sampled_from([0.0, 0.01, 0.1, 0.3]),
    ),
    max_size=60,
)


def play(sent: list[Arrival], first: int, capacity: int) -> tuple[Reorder, Played]:
    """Lets packets arrive, and time expire exactly when it is due, as a receiver does."""
    reorder, played = Reorder(first, WAIT_S, capacity), Played()
    order = sorted(range(len(sent)), key=lambda index: index + sent[index].delay)
    came_s: dict[int, float] = {}
    now_s = 0.0

    def note(delivered: list[Delivered], at_s: float) -> None:
        for each in delivered:
            index = int(each.payload)
            played.numbers.append(index)
            played.waits_s.append(at_s - came_s[index])
            played.missing += each.missing

    for index in order:
        until_s = now_s + sent[index].pause_s
        while reorder.deadline_s is not None and reorder.deadline_s <= until_s:
            now_s = reorder.deadline_s
            note(reorder.expire(now_s), now_s)
        now_s = until_s
        for _ in range(sent[index].copies):
            came_s.setdefault(index, now_s)
            note(reorder.put((first + index) % (LAST + 1), b"%d" % index, now_s), now_s)
    while reorder.deadline_s is not None:
        now_s = reorder.deadline_s
        note(reorder.expire(now_s), now_s)
    return reorder, played


@given(arrivals, st.sampled_from([0, 5, LAST, LAST - 20]), st.sampled_from([1, 3, 4096]))
def test_any_arrival_comes_out_in_order_once_and_in_time(
    sent: list[Arrival], first: int, capacity: int
) -> None:
    reorder, played = play(sent, first, capacity)
    assert played.numbers == sorted(set(played.numbers)), "in order, each at most once"
    assert all(wait_s <= WAIT_S + 1e-9 for wait_s in played.waits_s), "none later than the bound"
    assert reorder.held == 0
    last = max(played.numbers, default=-1)
    assert played.missing == reorder.given_up == last + 1 - len(played.numbers), "given up, counted exactly"
    came = sum(each.copies for each in sent)
    assert came == len(played.numbers) + reorder.dropped, "every packet is accounted for"


@given(arrivals)
def test_nothing_is_given_up_that_comes_in_time(sent: list[Arrival]) -> None:
    for each in sent:
        each.copies, each.pause_s = max(1, each.copies), 0.01
    reorder, played = play(sent, 0, 4096)
    assert played.numbers == list(range(len(sent)))
    assert reorder.given_up == 0
