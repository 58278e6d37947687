"""The ring of events: whatever a subscriber goes through, it gets each event once, or a gap."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import InvalidRequestError
from gateway.status.event import ControlAction, ControlResult, Event, ModeChanged
from gateway.status.event_log import (
    CAPACITY,
    MAX_OLDER_ACTIONS,
    ON_OVERLAY,
    EventLog,
    Gap,
    GapReason,
    Position,
)
from gateway.status.fault import Severity


def event_of(words: str, sentence: str | None = None) -> Event:
    return Event(Severity.INFO, "mission", words, ModeChanged(words), sentence)


def action(result: ControlResult = ControlResult.ACCEPTED) -> Event:
    detail = ControlAction("anna", "10.0.0.5:4", "SetPreviewMode", "enabled: true", result, "done")
    return Event(Severity.INFO, "gateway", "an action", detail)


def filled(count: int, kept: int = 4, run_id: str = "run") -> EventLog:
    log = EventLog(run_id, kept, unix_ms=lambda: 0)
    for number in range(1, count + 1):
        log.add(event_of(f"event {number}"), float(number))
    return log


def sequences(log: EventLog, after: Position | None, at_most: int = 100) -> list[int]:
    return [event.sequence for event in log.read(after, at_most).events]


def test_who_comes_without_a_position_takes_what_is_kept() -> None:
    reading = filled(6).read(None, 100)
    assert reading.gap is None
    assert [event.sequence for event in reading.events] == [3, 4, 5, 6]
    assert reading.position == Position("run", 6)


def test_who_was_there_goes_on_where_it_stopped() -> None:
    log = filled(6)
    assert sequences(log, Position("run", 4)) == [5, 6]
    assert sequences(log, Position("run", 6)) == []
    assert log.read(Position("run", 2), 100).gap is None, "the first kept one is the next"


def test_a_long_reading_is_cut() -> None:
    reading = filled(6).read(None, 3)
    assert [event.sequence for event in reading.events] == [3, 4, 5]
    assert reading.position == Position("run", 5)


def test_a_late_subscriber_learns_how_many_it_missed() -> None:
    reading = filled(10).read(Position("run", 2), 100)
    assert reading.gap == Gap(GapReason.NO_LONGER_KEPT, 4, Position("run", 6))
    assert [event.sequence for event in reading.events] == [7, 8, 9, 10]


@pytest.mark.parametrize(("count", "missed"), [(0, 0), (3, 0), (4, 0), (6, 2)])
def test_another_run_is_a_gap_even_when_nothing_of_this_one_is_missing(count: int, missed: int) -> None:
    gap = filled(count).read(Position("an earlier run", 17), 100).gap
    assert gap == Gap(GapReason.NEW_RUN, missed, Position("run", missed))


def test_a_place_that_was_not_reached_is_refused() -> None:
    with pytest.raises(InvalidRequestError, match="event 7"):
        filled(6).read(Position("run", 7), 100)


def test_the_overlay_has_the_newest_few_with_a_count_of_its_own() -> None:
    log = EventLog("run")
    for number in range(1, ON_OVERLAY + 4):
        log.add(event_of("left out"), 0.0)
        log.add(event_of("read", f"sentence {number}"), float(number))
    assert [event.sequence for event in log.newest()] == list(range(4, ON_OVERLAY + 4))
    assert log.newest()[-1].message == f"sentence {ON_OVERLAY + 3}"
    assert log.sequence == 2 * (ON_OVERLAY + 3)


@pytest.mark.parametrize(
    ("result", "kept"),
    [(ControlResult.ACCEPTED, [2, 3, 5]), (ControlResult.FAILED, [2, 3, 5]), (ControlResult.REFUSED, [])],
)
def test_actions_outlast_the_ring_and_refusals_do_not(result: ControlResult, kept: list[int]) -> None:
    log = EventLog("run", 4, unix_ms=lambda: 0)
    for each in (
        event_of("x"),
        action(result),
        action(result),
        event_of("x"),
        action(result),
        *[event_of("x")] * 10,
    ):
        log.add(each, 0.0)
    subscriber = Subscriber()
    while subscriber.position != Position("run", 15):
        subscriber.read(log, 100, None)
    assert [sequence for _, sequence in subscriber.got] == [*kept, 12, 13, 14, 15]
    holes = [(gap.missed, gap.position.sequence) for gap in subscriber.gaps]
    assert holes == ([(1, 4), (6, 11)] if kept else [])


@pytest.mark.parametrize(
    ("after", "gap", "read"),
    [
        (None, None, [2, 3]),
        (Position("run", 0), Gap(GapReason.NO_LONGER_KEPT, 1, Position("run", 1)), [2, 3]),
        (Position("run", 1), None, [2, 3]),
        (Position("run", 2), None, [3]),
        (Position("run", 3), Gap(GapReason.NO_LONGER_KEPT, 3, Position("run", 6)), [7, 8]),
        (Position("run", 6), None, [7, 8]),
        (Position("earlier", 9), Gap(GapReason.NEW_RUN, 1, Position("run", 1)), [2, 3]),
    ],
)
def test_a_reading_ends_where_a_gap_begins(after: Position | None, gap: Gap | None, read: list[int]) -> None:
    log = EventLog("run", 2, unix_ms=lambda: 0)
    for each in (event_of("x"), action(), action(), *[event_of("x")] * 5):
        log.add(each, 0.0)
    reading = log.read(after, 100)
    assert (reading.gap, [each.sequence for each in reading.events]) == (gap, read)
    assert reading.position == Position("run", read[-1])
    assert sequences(log, after, 1) == read[:1]


def test_the_older_actions_are_bounded() -> None:
    log = EventLog("run", unix_ms=lambda: 0)
    for _ in range(CAPACITY + MAX_OLDER_ACTIONS + 50):
        log.add(action(), 0.0)
    for _ in range(2 * CAPACITY):
        log.add(event_of("x"), 0.0)
    assert len(log.read(None, 10_000).events) == MAX_OLDER_ACTIONS


class Subscriber:
    """Keeps what it gets, as a client would, and can prove that nothing is missing in silence."""

    def __init__(self) -> None:
        self.position: Position | None = None
        self.got: list[tuple[str, int]] = []
        self.gaps: list[Gap] = []

    def read(self, log: EventLog, at_most: int, lost_after: int | None) -> None:
        """One reading, of which only the first `lost_after` events arrive."""
        reading = log.read(self.position, at_most)
        if lost_after == 0:
            return
        if reading.gap:
            self.gaps.append(reading.gap)
            self.position = reading.gap.position
        for event in reading.events[:lost_after]:
            here = self.position
            if here is not None:
                assert (here.run_id, here.sequence + 1) == (log.run_id, event.sequence), "in order, no hole"
            self.position = Position(log.run_id, event.sequence)
            self.got.append((log.run_id, event.sequence))


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("happen"), st.integers(1, 12)),
        st.tuples(st.just("act"), st.integers(1, 3)),
        st.tuples(st.just("restart"), st.just(0)),
        st.tuples(st.just("read"), st.integers(1, 20)),
        st.tuples(st.just("break off"), st.integers(0, 6)),
    ),
    max_size=60,
)


@given(STEPS, st.integers(1, 8))
def test_each_event_comes_once_and_in_order_or_a_gap_accounts_for_it(
    steps: list[tuple[str, int]], kept: int
) -> None:
    runs, subscriber = [EventLog("run 0", kept, unix_ms=lambda: 0)], Subscriber()
    subscriber.position = Position("run 0", 0)
    for what, count in steps:
        log = runs[-1]
        match what:
            case "happen":
                for _ in range(count):
                    log.add(event_of("x"), 0.0)
            case "act":
                for _ in range(count):
                    log.add(action(), 0.0)
            case "restart":
                runs.append(EventLog(f"run {len(runs)}", kept, unix_ms=lambda: 0))
            case "read":
                subscriber.read(log, count, None)
            case _:
                subscriber.read(log, 20, count)
    while (log := runs[-1]).sequence and subscriber.position != Position(log.run_id, log.sequence):
        subscriber.read(log, 20, None)
    assert len(set(subscriber.got)) == len(subscriber.got), "none twice"
    last = runs[-1]
    of_last = [sequence for run_id, sequence in subscriber.got if run_id == last.run_id]
    missed = sum(gap.missed for gap in subscriber.gaps if gap.position.run_id == last.run_id)
    if last.sequence:
        assert len(of_last) + missed == last.sequence, "all of the newest run, or counted as missing"
