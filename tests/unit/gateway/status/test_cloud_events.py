"""Which events follow from the bridge's reports."""

from dataclasses import replace
from typing import Any

import pytest

from gateway.status.cloud import CloudState, CloudView, CopyReport, RecordingCopyState
from gateway.status.cloud_events import BURST, REMEMBERED, SETTLED_S, CloudEvents
from gateway.status.event import CloudChanged, Event, RecordingCopyChanged
from gateway.status.fault import Severity
from gateway.status.recording import RecorderView
from tests.support.cloud_views import NEVER, connected, copy_of, view
from tests.support.recorder_views import ended, idle
from tests.support.recorder_views import view as recorder_view

State = RecordingCopyState
NOW_S = 1000.0


class Ground:
    """Looks five times a second, as the gateway does."""

    def __init__(self) -> None:
        self.now_s = NOW_S
        self.events = CloudEvents()

    def look(self, seen: CloudView, recorder: RecorderView | None = None) -> list[Event]:
        return list(self.events.take(seen, recorder, self.now_s))

    def states(self, status: Any, seconds: float) -> list[CloudState]:
        """The states that are events while a status lasts."""
        found = []
        until_s = self.now_s + seconds
        while self.now_s < until_s:
            for each in self.look(view(status, self.now_s)):
                assert isinstance(each.detail, CloudChanged)
                found.append(each.detail.state)
            self.now_s += 0.2
        return found

    def copies(self, *copies: CopyReport) -> list[tuple[str, State, Severity]]:
        """The copies that are events, of a report in which each has come to its state just now."""
        return self.reported(*(replace(each, since_s=self.now_s) for each in copies))

    def reported(self, *copies: CopyReport) -> list[tuple[str, State, Severity]]:
        """The copies that are events, of a report."""
        found = []
        for each in self.look(view(connected(), self.now_s, copies=copies)):
            assert isinstance(each.detail, RecordingCopyChanged)
            found.append((each.detail.recording_id, each.detail.copy.state, each.severity))
        return found


OFFLINE = connected(state=CloudState.OFFLINE, last_error="no route")


def test_a_state_is_an_event_when_it_has_lasted() -> None:
    it = Ground()
    assert it.states(connected(), 10) == [], "the first is the baseline"
    assert it.states(OFFLINE, SETTLED_S - 0.5) == []
    assert it.states(connected(), 10) == []
    assert it.states(OFFLINE, 10) == [CloudState.OFFLINE]
    assert it.states(connected(), 10) == [CloudState.CONNECTED]


def test_one_that_flaps_is_no_event() -> None:
    it = Ground()
    it.states(connected(), 10)
    assert [it.states(each, 2) for _ in range(20) for each in (OFFLINE, connected())] == [[]] * 40


def test_each_state_says_how_much_it_matters_and_faults_have_their_own_sentence() -> None:
    for state, severity, has_sentence in (
        (CloudState.OFFLINE, Severity.INFO, True),
        (CloudState.REFUSED, Severity.ERROR, False),
        (CloudState.FAULTED, Severity.ERROR, False),
        (CloudState.UNREACHABLE, Severity.WARNING, False),
    ):
        it = Ground()
        it.states(connected(), 10)
        seen = view(connected(state=state, last_error="because"), it.now_s)
        assert it.look(seen) == []
        it.now_s += SETTLED_S
        (event,) = it.look(seen)
        assert (event.severity, bool(event.sentence)) == (severity, has_sentence)
        assert event.message.endswith(": because")


def test_a_copy_is_an_event_when_it_is_verified_and_once_when_it_fails() -> None:
    it = Ground()
    failed, verified = copy_of("b", State.FAILED, reason="no"), copy_of("b", State.VERIFIED)
    assert it.copies(copy_of("old", State.VERIFIED)) == [], "the first ones are the baseline"
    assert it.copies(copy_of("old", State.VERIFIED), copy_of("b", State.UPLOADING)) == []
    assert it.copies(failed) == [("b", State.FAILED, Severity.WARNING)]
    assert it.copies(copy_of("b", State.UPLOADING)) == []
    assert it.copies(failed) == [], "once until it succeeds"
    assert it.copies(verified) == [("b", State.VERIFIED, Severity.INFO)]
    assert it.copies(verified) == []
    assert it.copies(failed) == [("b", State.FAILED, Severity.WARNING)]


def test_the_label_is_the_recorders() -> None:
    it = Ground()
    it.copies()
    recorder = recorder_view(idle(), NOW_S, ended=(ended("b", label="lap"),))
    copied = replace(copy_of("b", State.VERIFIED), since_s=NOW_S)
    (event,) = it.look(view(connected(), NOW_S, copies=(copied,)), recorder)
    assert isinstance(event.detail, RecordingCopyChanged)
    assert event.detail.label == "lap"
    assert "lap (b)" in event.message


def test_a_bridge_that_makes_copies_up_floods_nothing() -> None:
    it = Ground()
    it.copies()
    count = 0
    for number in range(50 * REMEMBERED):
        count += len(it.copies(copy_of(str(number), State.VERIFIED)))
    assert count == BURST
    it.now_s += 10
    more = [copy_of(f"more {number}", State.FAILED) for number in range(20)]
    assert len(it.copies(*more)) == 10
    it.now_s += 10
    assert len(it.copies(*more)) == 10, "none is lost"


@pytest.mark.parametrize("state", [State.VERIFIED, State.FAILED])
@pytest.mark.parametrize("since_s", [NOW_S - 60.0, None], ids=["before the gateway", "before the bridge"])
def test_old_copies_that_the_first_report_had_no_room_for_are_no_news(
    state: State, since_s: float | None
) -> None:
    it = Ground()
    old = [replace(copy_of(str(number), state), since_s=since_s) for number in range(2 * BURST)]
    assert it.reported(*old[:BURST]) == []
    it.now_s += 1
    assert it.reported(*old[BURST:]) == []
    new = replace(copy_of("new", state), since_s=it.now_s - 0.5)
    assert [name for name, *_ in it.reported(new, *old[1:BURST])] == ["new"]


def test_while_it_does_not_answer_nothing_is_concluded_of_copies() -> None:
    it = Ground()
    assert it.look(NEVER) == []
    seen = view(connected(), NOW_S, copies=(copy_of("b", State.VERIFIED),))
    assert it.look(seen.lost("gone", NOW_S)) == []
    assert it.copies(copy_of("b", State.VERIFIED)) == [], "this is the baseline"


@pytest.mark.parametrize("state", [State.VERIFIED, State.FAILED])
def test_a_copy_that_was_seen_on_its_way_is_news_also_where_the_bridge_knows_no_age(state: State) -> None:
    """An older bridge says of no copy since when it has its state, a restarted one of none from before."""
    it = Ground()
    on_its_way = replace(copy_of("b", State.UPLOADING), since_s=None)
    assert it.reported(on_its_way) == []
    it.now_s += 60
    ended_copy = replace(copy_of("b", state), since_s=None)
    assert [name for name, *_ in it.reported(ended_copy)] == ["b"]
    assert it.reported(ended_copy) == []
