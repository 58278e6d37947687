"""The table of an upload's states, its backoff, and the order of the queue."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.uploads.queue import (
    MOST_CUTS,
    RUNNING,
    TRANSITIONS,
    WAITING,
    Event,
    IllegalEventError,
    Priority,
    State,
    Upload,
    in_order,
    next_upload,
    progressed,
    step,
)

UPLOAD = Upload(recording_id="one", size=100)


def test_the_table_has_every_state_and_only_a_receipt_verifies() -> None:
    assert set(TRANSITIONS) == set(State)
    for state, row in TRANSITIONS.items():
        for event, after in row.items():
            if after is State.VERIFIED and state is not State.VERIFIED:
                assert event is Event.CONFIRMED
                assert state in RUNNING


def test_an_event_that_can_t_happen_names_state_and_event() -> None:
    with pytest.raises(IllegalEventError, match="'sent' can't happen to an upload that is local"):
        step(UPLOAD, Event.SENT, 0)


def test_the_way_of_an_upload() -> None:
    upload = UPLOAD
    for event, state in (
        (Event.ENQUEUE, State.QUEUED),
        (Event.BEGIN, State.UPLOADING),
        (Event.FAILURE, State.FAILED),
        (Event.RESUME, State.QUEUED),
        (Event.BEGIN, State.UPLOADING),
        (Event.SENT, State.VERIFYING),
        (Event.CONFIRMED, State.VERIFIED),
        (Event.RESTART, State.VERIFIED),
        (Event.ENQUEUE, State.VERIFIED),
        (Event.CHANGED, State.QUEUED),
        (Event.REMOVE, State.LOCAL),
    ):
        upload = step(upload, event, 10.0, "because")
        assert upload.state is state
        assert upload.reason == ("because" if state is State.FAILED else "")
    assert upload.failures == 0


def test_a_state_has_its_instant_unless_it_was_there_before_the_start() -> None:
    verified = replace(UPLOAD, state=State.VERIFIED)
    assert step(verified, Event.RESTART, 5.0).since_s is None
    upload = step(UPLOAD, Event.ENQUEUE, 5.0)
    assert upload.since_s == 5.0
    assert step(upload, Event.ENQUEUE, 6.0).since_s == 5.0
    assert step(upload, Event.BEGIN, 7.0).since_s == 7.0


def test_failures_of_its_own_are_counted_and_pause_it_longer_each_time() -> None:
    upload = replace(UPLOAD, state=State.UPLOADING)
    for count, due_s in ((1, 1.0), (2, 2.0), (3, 4.0)):
        upload = step(upload, Event.FAILURE, 0.0, "no")
        assert (upload.failures, upload.due_s) == (count, due_s)
        upload = step(step(upload, Event.RESUME, 0.0), Event.BEGIN, 0.0)
    cut = step(upload, Event.CUT, 5.0, "no network")
    assert (cut.state, cut.reason, cut.failures, cut.due_s) == (State.FAILED, "no network", 3, 0.0)


@given(st.lists(st.sampled_from(Event), max_size=40))
def test_no_sequence_of_events_ends_outside_the_table(events: list[Event]) -> None:
    upload = UPLOAD
    for event in events:
        if event in TRANSITIONS[upload.state]:
            upload = step(upload, event, 1.0, "why")
        assert (upload.state in WAITING) == (upload.state not in {State.LOCAL, State.VERIFIED})
        assert bool(upload.reason) == (upload.state in {State.PAUSED, State.FAILED})


def test_the_most_urgent_is_next_and_one_that_just_failed_waits() -> None:
    old, new = (
        replace(UPLOAD, recording_id=name, state=State.QUEUED, started_unix_ms=start)
        for name, start in (("old", 1), ("new", 2))
    )
    by_hand = replace(new, recording_id="hand", priority=Priority.BY_HAND)
    failed = replace(old, recording_id="incident", priority=Priority.INCIDENT, state=State.FAILED, due_s=10.0)
    uploads = [new, old, by_hand, failed]
    assert next_upload(uploads, 0.0) is by_hand
    assert next_upload(uploads, 10.0) is failed
    assert next_upload([replace(new, state=State.VERIFIED), UPLOAD], 0.0) is None
    running = replace(new, recording_id="runs", state=State.UPLOADING)
    assert [each.recording_id for each in in_order([*uploads, running])] == [
        "runs",
        "incident",
        "hand",
        "old",
        "new",
    ]


def test_cuts_in_succession_without_progress_are_a_failure_of_the_recording() -> None:
    upload = replace(UPLOAD, state=State.UPLOADING)
    for _ in range(MOST_CUTS - 1):
        upload = step(upload, Event.CUT, 100.0, "cut")
        assert (upload.state, upload.due_s) == (State.FAILED, 0.0), "all of the queue waits"
        upload = step(step(upload, Event.RESUME, 100.0), Event.BEGIN, 100.0)
    for failures in (1, 2, 3):
        failed = step(upload, Event.CUT, 100.0, "cut")
        assert (failed.failures, failed.due_s) == (failures, 100.0 + 2 ** (failures - 1))
        upload = step(step(failed, Event.RESUME, 200.0), Event.BEGIN, 200.0)


def test_progress_ends_a_succession_of_cuts() -> None:
    upload = replace(UPLOAD, state=State.UPLOADING, bytes_done=10, cuts=MOST_CUTS - 1)
    assert progressed(upload, 10).cuts == MOST_CUTS - 1
    assert progressed(upload, 11).cuts == 0
    assert progressed(upload, 1000).bytes_done == upload.size


def test_what_is_cut_again_and_again_goes_last_until_the_path_has_been_seen_to_work() -> None:
    cut = replace(UPLOAD, recording_id="cut", priority=Priority.INCIDENT, state=State.FAILED, cuts=MOST_CUTS)
    other = replace(UPLOAD, recording_id="other", state=State.QUEUED)
    assert next_upload([cut, other], 0.0, path_works=False) == other
    assert next_upload([cut], 0.0, path_works=False) == cut
    assert next_upload([cut, other], 0.0, path_works=True) == cut
    assert next_upload([replace(cut, due_s=9.0), other], 0.0, path_works=True) == other
