"""What wakes watchers, and what does not."""

from dataclasses import fields, replace
from typing import Any

import pytest

from gateway.status.board import Board
from gateway.status.change import EXCLUDED, PROJECTIONS, change_key
from gateway.status.cloud import CloudState, RecordingCopy, RecordingCopyState
from gateway.status.fault import Condition, Fault, Severity
from gateway.status.preview import Measurement, PreviewState
from gateway.status.recording import RecorderState, RecorderView
from gateway.status.snapshot import Runtime, Snapshot, SourceRule
from gateway.status.sources import MODE, ODOMETRY
from gateway.status.teleop import DrivePhase
from gateway.status.values import Mode, Received, Velocity
from tests.support.cloud_views import connected
from tests.support.cloud_views import view as cloud_view
from tests.support.drive_views import actual, stopped_view
from tests.support.recorder_views import status, view
from tests.support.status import OFF, snapshot_of

FAULT = Fault(Condition("odometry.stale", Severity.ERROR, "odometry", "m", "r"), 90.0, 100.0, None, 1)


def snapshot(now_s: float = 100.0, **changed: Any) -> Snapshot:
    values: dict[str, Any] = {
        "board": Board({ODOMETRY: Received(Velocity(0.5, 0, 0), 99.9), MODE: Received(Mode("idle"), 99.0)}),
        "sources": {ODOMETRY: SourceRule(1000, required=True), MODE: SourceRule(60_000, required=False)},
        "preview": replace(OFF, measured=Received(Measurement(30, 2500, 1, 10, None, None), 99.9)),
        "faults": (FAULT,),
        "gateway": Runtime("r", "b", 1000, 1, 1, 0),
    }
    return snapshot_of(now_s=now_s, **(values | changed))


BEFORE = change_key(snapshot())


@pytest.mark.parametrize(
    "later",
    [
        pytest.param(snapshot(now_s=100.5), id="time goes by"),
        pytest.param(snapshot(gateway=Runtime("r", "b", 2000, 7, 99, 3)), id="others ask"),
        pytest.param(
            snapshot(
                board=Board(
                    {ODOMETRY: Received(Velocity(0.5, 0, 0), 99.99), MODE: Received(Mode("idle"), 99.5)}
                )
            ),
            id="the same values come again",
        ),
        pytest.param(snapshot(faults=(replace(FAULT, seen_s=100.2),)), id="a fault goes on"),
    ],
)
def test_this_is_no_change(later: Snapshot) -> None:
    assert change_key(later) == BEFORE


@pytest.mark.parametrize(
    "later",
    [
        pytest.param(
            snapshot(board=Board({ODOMETRY: Received(Velocity(0.6, 0, 0), 99.9)})), id="another speed"
        ),
        pytest.param(snapshot(now_s=101.5), id="it grows stale"),
        pytest.param(snapshot(faults=()), id="a fault is gone"),
        pytest.param(snapshot(faults=(replace(FAULT, cleared_s=100.0),)), id="a fault has cleared"),
        pytest.param(snapshot(preview=replace(OFF, state=PreviewState.RUNNING)), id="the preview runs"),
        pytest.param(
            snapshot(preview=replace(OFF, measured=Received(Measurement(29, 2500, 1, 10, None, None), 99.9))),
            id="the preview is slower",
        ),
    ],
)
def test_this_is_a_change(later: Snapshot) -> None:
    assert change_key(later) != BEFORE


def test_a_recording_that_grows_is_no_change_and_what_an_operator_acts_on_is_one() -> None:
    before = change_key(snapshot(recorder=view(status(), 99.0)))
    grown = status(elapsed_ms=9**9, size=9**9, messages_written=9**9, bytes_per_s=1, room_bytes=1, room_s=1)
    assert change_key(snapshot(recorder=view(grown, 100.0, disk_free_bytes=1))) == before
    for changed in (
        status(state=RecorderState.FINALISING),
        status(recording_id="another"),
        status(messages_lost=18),
        status(uncounted_gaps=14),
        status(last_error="no room"),
        status(snapshots_pending=4),
    ):
        assert change_key(snapshot(recorder=view(changed, 99.0))) != before
    assert change_key(snapshot(recorder=RecorderView("gone"))) != before


def test_copying_that_goes_on_is_no_change_and_another_state_is_one() -> None:
    uploading = RecordingCopy(RecordingCopyState.UPLOADING, bytes_done=1)
    reported = connected(uploading=uploading, uploading_id="a")
    before = change_key(snapshot(cloud=cloud_view(reported, 99.0)))
    grown = replace(
        reported,
        uploading=replace(uploading, bytes_done=9**9),
        events_sent=9,
        outbox_bytes=9,
        outbox_events=9,
        state_age_ms=9,
        upload_bytes_per_s=9,
    )
    assert change_key(snapshot(cloud=cloud_view(grown, 100.0))) == before
    for changed in (
        replace(reported, state=CloudState.OFFLINE),
        replace(reported, uploading=RecordingCopy(RecordingCopyState.VERIFYING)),
        replace(reported, uploads_waiting=1),
        replace(reported, uploads_left_out=1),
        replace(reported, last_error="gone"),
    ):
        assert change_key(snapshot(cloud=cloud_view(changed, 99.0))) != before
    assert change_key(snapshot(cloud=cloud_view(reported, 99.0).lost("gone", 99.0))) != before


def test_every_field_of_the_snapshot_is_projected_or_excluded_by_name() -> None:
    assert PROJECTIONS.keys() | EXCLUDED == {field.name for field in fields(Snapshot)}
    assert not PROJECTIONS.keys() & EXCLUDED


def test_driving_wakes_watchers_when_an_operator_would_act_on_it_and_not_with_each_velocity() -> None:
    view = stopped_view(100.0)
    drive = view.drive
    moved = replace(drive, actual=actual(phase=DrivePhase.STOPPED, stop=drive.stop, monotonic_ns=2))
    before = change_key(snapshot(teleop=view))
    assert change_key(snapshot(teleop=replace(view, drive=moved))) == before
    for changed in (
        replace(view, holder="another"),
        replace(view, inhibits=()),
        replace(view, drive=replace(drive, error="gone")),
        replace(view, drive=replace(drive, actual=actual(phase=DrivePhase.ARMED))),
    ):
        assert change_key(snapshot(teleop=changed)) != before
