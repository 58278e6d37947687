"""The position of a subscriber: no event twice and no silent gap, for any input."""

from hypothesis import given
from hypothesis import strategies as st

from console.client.event_feed import EventFeed
from console.client.mapping.methods import events_request
from console.client.results import (
    CaughtUp,
    Event,
    EventGap,
    EventKind,
    EventPosition,
    FaultSeverity,
    GapReason,
)


def event(sequence: int, run_id: str = "run") -> Event:
    return Event(
        position=EventPosition(run_id, sequence),
        monotonic_ns=0,
        wall_clock_unix_ms=0,
        severity=FaultSeverity.INFO,
        component="c",
        message="m",
        kind=EventKind.MODE,
    )


def taken(feed: EventFeed, *items: Event | EventGap | CaughtUp | None) -> list[object]:
    return [piece for item in items for piece in feed.take(item)]


def test_a_feed_begins_at_its_position_and_resumes_after_the_last() -> None:
    feed = EventFeed(EventPosition("run", 4), FaultSeverity.WARNING)
    assert feed.request() == events_request(EventPosition("run", 4), FaultSeverity.WARNING)
    taken(feed, event(5))
    assert feed.request() == events_request(EventPosition("run", 5), FaultSeverity.WARNING)


def test_a_duplicate_is_dropped() -> None:
    feed = EventFeed()
    assert taken(feed, event(1), event(2), event(2), event(1)) == [event(1), event(2)]


def test_what_only_a_newer_client_understands_is_left_out() -> None:
    feed = EventFeed()
    assert taken(feed, event(1), None) == [event(1)]
    assert feed.position == EventPosition("run", 1)


def test_an_announced_gap_moves_the_feed_on() -> None:
    gap = EventGap(reason=GapReason.NO_LONGER_KEPT, missed_count=3, position=EventPosition("run", 5))
    assert taken(EventFeed(EventPosition("run", 2)), gap, event(6)) == [gap, event(6)]


def test_an_unannounced_hole_becomes_a_gap() -> None:
    gap = EventGap(reason=GapReason.UNKNOWN, missed_count=2, position=EventPosition("run", 3))
    assert taken(EventFeed(), event(1), event(4)) == [event(1), gap, event(4)]


def test_who_leaves_events_out_sees_no_holes() -> None:
    feed = EventFeed(least=FaultSeverity.ERROR)
    assert taken(feed, event(1), event(9)) == [event(1), event(9)]


def test_an_unannounced_run_becomes_a_gap() -> None:
    gap = EventGap(reason=GapReason.NEW_RUN, missed_count=1, position=EventPosition("later", 1))
    assert taken(EventFeed(), event(1), event(2, "later")) == [event(1), gap, event(2, "later")]


def test_caught_up_moves_the_feed_on_past_what_was_left_out() -> None:
    feed = EventFeed(least=FaultSeverity.ERROR)
    taken(feed, event(1), CaughtUp(position=EventPosition("run", 7)))
    assert feed.request() == events_request(EventPosition("run", 7), FaultSeverity.ERROR)


@given(st.lists(st.tuples(st.sampled_from(["a", "b"]), st.integers(1, 9)), max_size=60))
def test_whatever_comes_positions_only_go_on(sent: list[tuple[str, int]]) -> None:
    feed, here = EventFeed(), None
    for run_id, sequence in sent:
        for piece in taken(feed, event(sequence, run_id)):
            assert isinstance(piece, Event | EventGap)
            there = piece.position
            if here is not None and there.run_id == here.run_id:
                assert there.sequence > here.sequence
                if isinstance(piece, Event):
                    assert there.sequence == here.sequence + 1, "a gap comes before"
            here = there
