"""Which events follow from the recorder's reports."""

from dataclasses import replace
from typing import Any

from gateway.status.event import RecordingChanged
from gateway.status.fault import Severity
from gateway.status.recording import (
    RecorderStatus,
    RecordingChange,
    RecordingKind,
    RecordingState,
    RecordingStopReason,
)
from gateway.status.recording_events import RecordingEvents
from tests.support.recorder_views import ended, idle, status, view

NOW_S = 1000.0


def seen(events: RecordingEvents, reported: RecorderStatus, at_s: float = NOW_S, **more: Any) -> list[Any]:
    """Change, recording and severity of each event."""
    found = []
    for each in events.take(view(reported, at_s, **more)):
        assert isinstance(each.detail, RecordingChanged)
        found.append((each.detail.change, each.detail.recording_id, each.severity))
    return found


def begun(reported: RecorderStatus | None = None, **more: Any) -> RecordingEvents:
    """With the baseline."""
    events = RecordingEvents()
    assert seen(events, reported or idle(), **more) == []
    return events


def test_what_was_there_before_is_no_event() -> None:
    events = begun(status(), ended=(ended("old"),))
    assert seen(events, status(), ended=(ended("old"),)) == []


def test_a_recording_begins_and_ends() -> None:
    events = begun()
    running = status(recording_id="a", messages_lost=0, uncounted_gaps=0)
    assert seen(events, running) == [(RecordingChange.STARTED, "a", Severity.INFO)]
    assert seen(events, running) == []
    assert seen(events, idle(), ended=(ended("a"),)) == [(RecordingChange.ENDED, "a", Severity.INFO)]
    assert seen(events, idle(), ended=(ended("a"),)) == []


def test_one_ends_and_the_next_begins_between_two_looks() -> None:
    events = begun(status(recording_id="a"))
    following = status(recording_id="b", messages_lost=0, uncounted_gaps=0)
    assert [each[:2] for each in seen(events, following, ended=(ended("a"),))] == [
        (RecordingChange.ENDED, "a"),
        (RecordingChange.STARTED, "b"),
    ]


def test_why_it_ended_is_how_much_it_matters() -> None:
    for reason, severity in (
        (RecordingStopReason.LIMIT, Severity.INFO),
        (RecordingStopReason.SHUTDOWN, Severity.INFO),
        (RecordingStopReason.INTERRUPTED, Severity.WARNING),
        (RecordingStopReason.DISK, Severity.ERROR),
        (RecordingStopReason.ERROR, Severity.ERROR),
    ):
        ((_, _, found),) = seen(begun(), idle(), ended=(ended("a", stop_reason=reason),))
        assert found is severity


def test_a_snapshot_is_complete_unless_the_disk_ended_it() -> None:
    whole = ended("a", kind=RecordingKind.SNAPSHOT)
    assert seen(begun(), idle(), ended=(whole,)) == [(RecordingChange.SNAPSHOT_COMPLETE, "a", Severity.INFO)]
    cut = replace(whole, state=RecordingState.FAULTED, stop_reason=RecordingStopReason.DISK)
    assert seen(begun(), idle(), ended=(cut,)) == [(RecordingChange.ENDED, "a", Severity.ERROR)]


def test_a_run_folder_of_the_robot_is_no_recording_that_ended() -> None:
    assert seen(begun(), idle(), ended=(ended("a", kind=RecordingKind.RUN_BUNDLE),)) == []


def test_losses_close_to_each_other_are_one_event() -> None:
    events = begun(status(recording_id="a", messages_lost=2))
    times = [
        second
        for second in range(25)
        if seen(events, status(recording_id="a", messages_lost=3 + second), NOW_S + second)
    ]
    assert times == [0], "it never stopped losing"
    lost = status(recording_id="a", messages_lost=99)
    assert seen(events, lost, NOW_S + 40) == [(RecordingChange.LOSS, "a", Severity.WARNING)]


def test_a_gap_of_unknown_size_is_a_loss_though_no_message_was_counted() -> None:
    nothing = status(recording_id="a", label="", messages_lost=0, uncounted_gaps=0)
    events = begun(nothing)
    assert seen(events, nothing) == []
    (event,) = events.take(view(replace(nothing, messages_lost=None, uncounted_gaps=1), NOW_S))
    assert event.message == "recording a loses messages: 1 gap of unknown size so far"
    assert isinstance(event.detail, RecordingChanged)
    assert (event.detail.messages_lost, event.detail.uncounted_gaps) == (None, 1)
    (event,) = events.take(view(replace(nothing, messages_lost=7, uncounted_gaps=2), NOW_S + 60))
    assert event.message == "recording a loses messages: 7 so far, and 2 gaps of unknown size"


def test_while_it_does_not_answer_nothing_is_concluded() -> None:
    events = begun(status(recording_id="a"))
    gone = replace(view(idle(), NOW_S), error="gone")
    assert list(events.take(gone)) == []
    assert [each[0] for each in seen(events, idle(), ended=(ended("a"),))] == [RecordingChange.ENDED]
