"""What the gateway's stream becomes in the outbox's order."""

from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bridge.events.values import DropReason, Event, Gap, Item, Position
from bridge.robot.feed import MOST_EVENT_BYTES, Feed, FeedError
from omniseer.gateway.v1 import event_pb2
from omniseer.gateway.v1.robot_gateway_pb2 import SubscribeEventsResponse

KEPT = DropReason.NO_LONGER_KEPT


def event(sequence: int, run_id: str = "a", message: str = "") -> SubscribeEventsResponse:
    return SubscribeEventsResponse(
        event=event_pb2.Event(run_id=run_id, sequence=sequence, severity=2, message=message)  # type: ignore[arg-type]
    )


def caught_up(sequence: int, run_id: str = "a") -> SubscribeEventsResponse:
    return SubscribeEventsResponse(caught_up=event_pb2.EventPosition(run_id=run_id, sequence=sequence))


def gap(sequence: int, run_id: str = "a") -> SubscribeEventsResponse:
    place = event_pb2.EventPosition(run_id=run_id, sequence=sequence)
    return SubscribeEventsResponse(gap=event_pb2.EventGap(position=place, missed_count=1))


def fed(feed: Feed, *responses: SubscribeEventsResponse) -> list[Item]:
    return [item for each in responses for item in feed.take(each, KEPT)]


def sequences(items: list[Item]) -> list[int]:
    return [item.first for item in items if isinstance(item, Event)]


def test_events_pass_and_repeated_ones_do_not() -> None:
    feed = Feed(Position("a", 3))
    items = fed(feed, event(3), event(4), event(4), event(5))
    assert sequences(items) == [4, 5]
    assert feed.position == Position("a", 5)


def test_an_event_stays_as_the_gateway_issued_it() -> None:
    (item,) = fed(Feed(Position("a", 3)), event(4, message="a fault"))
    assert isinstance(item, Event)
    assert event_pb2.Event.FromString(item.payload) == event(4, message="a fault").event
    assert item.severity == 2


def test_announced_gaps_and_jumps_are_gaps() -> None:
    feed = Feed(Position("a", 3))
    items = fed(feed, gap(6), event(7), event(10), caught_up(12))
    assert [(each.first, each.last) for each in items if isinstance(each, Gap)] == [(4, 6), (8, 9), (11, 12)]


def test_a_new_run_says_that_the_earlier_one_may_have_had_more() -> None:
    feed = Feed(Position("a", 3))
    assert fed(feed, event(1, "b"))[0] == Gap("b", 1, 0, KEPT, earlier=True)
    feed = Feed(Position("a", 3))
    assert fed(feed, gap(7, "b"), event(8, "b"))[0] == Gap("b", 1, 7, KEPT, earlier=True)
    feed = Feed(Position("a", 3))
    assert fed(feed, caught_up(0, "b")) == [Gap("b", 1, 0, KEPT, earlier=True)]


def test_a_new_outbox_begins_after_all_there_was() -> None:
    feed = Feed(None, probes=3)
    lost = DropReason.OUTBOX_LOST
    assert fed(feed, event(4), gap(6), event(7), caught_up(9)) == [
        Gap("a", 1, 9, lost, earlier=True, probes=3)
    ]
    assert sequences(fed(feed, event(10))) == [10]


def test_a_huge_event_is_shortened() -> None:
    (item,) = fed(Feed(Position("a", 3)), event(4, message="x" * 100_000))
    assert isinstance(item, Event)
    assert len(item.payload) < 2000 < MOST_EVENT_BYTES
    assert "shortened" in event_pb2.Event.FromString(item.payload).message


@pytest.mark.parametrize("run_id", ["", "a.b", "a b", "*", ">", "x" * 65])
def test_a_run_that_is_no_part_of_a_subject_is_refused(run_id: str) -> None:
    with pytest.raises(FeedError, match="part of a subject"):
        fed(Feed(Position("a", 3)), event(1, run_id))


@pytest.mark.parametrize("make", [event, gap, caught_up])
def test_a_number_that_the_outbox_can_t_hold_is_refused(make: Any) -> None:
    """The defect: SQLite refused it in a way that ended the bridge, again and again."""
    for position in (Position("a", 3), None):
        feed = Feed(position)
        if position is None and make is not caught_up:
            continue
        with pytest.raises(FeedError, match="which can't be"):
            fed(feed, make(2**63 + 1, "a"))
        assert feed.position == position


_RESPONSES = st.builds(
    lambda make, sequence, run_id: make(sequence, run_id),
    st.sampled_from([event, gap, caught_up]),
    st.integers(0, 12),
    st.sampled_from(["a", "b"]),
)


@given(st.lists(_RESPONSES, max_size=30))
@example([event(0, "b")])
def test_whatever_comes_there_is_no_hole_and_nothing_twice(responses: list[SubscribeEventsResponse]) -> None:
    feed = Feed(Position("a", 0))
    here = feed.position
    for item in fed(feed, *responses):
        assert here
        if isinstance(item, Gap) and item.earlier:
            assert item.first == 1
            assert item.run_id != here.run_id
        else:
            assert (item.run_id, item.first) == (here.run_id, here.sequence + 1)
        here = Position(item.run_id, item.last)
    assert feed.position == here
