"""The recording panel in every state: what it says, what can be pressed, and why the rest can't."""

from dataclasses import replace
from pathlib import Path

import pytest

from console.client import Recording, RecordingStatus
from console.client.results import (
    Fault,
    FaultSeverity,
    RecorderState,
    RecordingKind,
    RecordingState,
    RecordingStopReason,
)
from console.monitor.export_meter import ExportRate
from console.monitor.link import LinkState
from console.monitor.monitor_state import MonitorState
from console.monitor.recorder_controls import (
    NOT_SET_UP,
    WAITING,
    RecorderControls,
    RecordingItem,
    deletion_question,
    recorder_controls,
)
from console.monitor.recordings_view import Change, ChangeRequest, ExportState, ExportView, RecordingsView
from console.presentation.severity_style import SeverityStyle
from tests.support.played_recordings import DRIVING, ENDED, IDLE, RECORDS
from tests.support.snapshots import NOW_S, heard, snapshot

LISTED = RecordingsView(listed=(ENDED,))
RUNNING = replace(ENDED, id="lap", state=RecordingState.RECORDING, stop_reason=RecordingStopReason.UNKNOWN)
COPY = ExportView(folder=Path("there/one"))


def state(status: RecordingStatus | None, *faults: Fault) -> MonitorState:
    taken = snapshot()
    return heard(replace(taken, status=replace(taken.status, recording=status, faults=faults)))


def fault(name: str, severity: FaultSeverity, message: str) -> Fault:
    return Fault(
        id=name,
        severity=severity,
        component="recording",
        message=message,
        remedy="Look at it",
        active=True,
        age_ms=0,
        cleared_age_ms=None,
        times_raised=1,
    )


def of(
    status: RecordingStatus | None, view: RecordingsView = LISTED, *faults: Fault, preset: str = ""
) -> RecorderControls:
    return recorder_controls(state(status, *faults), view, preset, NOW_S)


def item(recording: Recording, status: RecordingStatus = IDLE, **view: object) -> RecordingItem:
    shown = replace(LISTED, listed=(recording,), **view)  # type: ignore[arg-type]
    (only,) = of(status, shown).items
    return only


def notes(now: RecorderControls) -> list[tuple[str, SeverityStyle]]:
    return [(note.text, note.style) for note in now.notes]


def test_a_robot_without_a_recorder_has_no_panel_and_the_reason_is_said() -> None:
    now = of(None)
    assert now.absent == NOT_SET_UP
    assert now.tile is None
    assert not now.record.enabled


def test_before_the_first_status_nothing_is_known() -> None:
    now = recorder_controls(MonitorState(heard().link), RecordingsView(), "", NOW_S)
    assert not now.absent
    assert (now.record.reason, now.keep.reason) == ("No status received yet", "No status received yet")


def test_idle_it_can_be_started_and_the_last_seconds_kept() -> None:
    now = of(IDLE)
    assert (now.mark, now.style) == ("IDLE", SeverityStyle.QUIET)
    assert (now.record.text, now.record.enabled, now.on) == ("Record", True, False)
    assert (now.keep.text, now.keep.enabled) == ("Keep the last 30 s", True)
    assert now.running == "Nothing is recorded"
    assert not now.notes


def test_a_recording_that_runs_shows_time_size_and_room_at_the_present_rate() -> None:
    now = of(RECORDS)
    assert (now.mark, now.style) == ("RECORDING", SeverityStyle.GOOD)
    assert (now.record.text, now.record.enabled, now.on, now.running_id) == (
        "Stop recording",
        True,
        True,
        "lap",
    )
    assert now.running == "2 min 05 s, 40.0 MB, with video, lap 1"
    assert now.room == "Room for 100 min at 1.0 MB/s"
    assert now.tile
    assert (now.tile.word, now.tile.detail, now.tile.style) == ("REC", "room 100 min", SeverityStyle.GOOD)
    assert "without video" in of(replace(RECORDS, video=False)).running
    assert "17 messages lost" in of(replace(RECORDS, messages_lost=17)).running
    assert of(replace(RECORDS, uncounted_gaps=1)).running.endswith("lap 1, 1 gap of unknown size")


def test_idle_the_room_is_that_of_the_chosen_preset() -> None:
    assert of(IDLE).room == "Room for 6.0 GB: 100 min of driving"
    slim = replace(DRIVING, name="slim", bytes_per_minute=1_000_000)
    both = replace(IDLE, presets=(DRIVING, slim))
    assert of(both, preset="slim").room == "Room for 6.0 GB: 100 h 00 min of slim"
    assert of(replace(IDLE, presets=(replace(DRIVING, bytes_per_minute=0),))).room == "Room for 6.0 GB"
    assert of(replace(IDLE, presets=())).room == "Room for 6.0 GB"


def test_presets_say_what_they_mean() -> None:
    (choice,) = of(IDLE).presets
    assert (choice.name, choice.meaning) == ("driving", "motion and state, with video, 60.0 MB a minute")


@pytest.mark.parametrize(
    ("recorder", "reason"),
    [
        (RecorderState.UNREACHABLE, "The recorder does not answer. What it records at present goes on"),
        (RecorderState.RECOVERING, "Recordings that were cut off are being recovered"),
        (RecorderState.STARTING, "A recording is being opened"),
        (RecorderState.FINALISING, "A recording is being closed"),
    ],
)
def test_a_recorder_that_is_busy_or_gone_bars_every_change(recorder: RecorderState, reason: str) -> None:
    now = of(replace(IDLE, state=recorder))
    (only,) = now.items
    for action in (now.record, now.keep, only.pin, only.delete):
        assert action.reason == reason
    assert only.export.enabled is (recorder is not RecorderState.UNREACHABLE)


def test_a_disk_that_fails_is_red_and_bars_recording_alone() -> None:
    broken = replace(IDLE, state=RecorderState.FAULTED, last_error="the disk is read-only")
    now = of(broken)
    assert (now.mark, now.style) == ("FAULTED, CAN'T RECORD", SeverityStyle.BAD)
    assert (now.record.reason, now.keep.reason) == ("the disk is read-only", "the disk is read-only")
    assert notes(now) == [("the disk is read-only", SeverityStyle.BAD)]
    assert now.items[0].export.enabled
    assert now.tile
    assert now.tile.style is SeverityStyle.BAD


def test_a_robot_that_does_not_answer_bars_everything_and_says_what_was_known() -> None:
    late = recorder_controls(state(RECORDS), LISTED, "", NOW_S + 10)
    assert (late.mark, late.style) == ("LAST KNOWN: RECORDING", SeverityStyle.WARNING)
    (only,) = late.items
    for action in (late.record, late.keep, only.export, only.pin, only.delete):
        assert action.reason == "The robot does not answer"
    lost = state(IDLE)
    lost = replace(lost, link=replace(lost.link, state=LinkState.LOST))
    assert recorder_controls(lost, LISTED, "", NOW_S).record.reason == "The robot does not answer"


def test_short_room_is_a_warning_before_it_bites() -> None:
    short = of(replace(RECORDS, room_s=3599))
    assert (short.mark, short.style) == ("RECORDING, LOW ROOM", SeverityStyle.WARNING)
    assert notes(short) == [
        ("Low room: export recordings to this computer and delete them", SeverityStyle.WARNING)
    ]
    assert short.record.enabled
    assert of(replace(RECORDS, room_s=3600)).style is SeverityStyle.GOOD
    full = of(replace(IDLE, room_bytes=0))
    assert (full.mark, full.style) == ("IDLE, NO ROOM", SeverityStyle.WARNING)
    assert full.tile
    assert full.tile.style is SeverityStyle.WARNING


def test_the_recorders_own_faults_come_first_and_once() -> None:
    nearly = fault("recording.disk", FaultSeverity.WARNING, "the disk for recordings is nearly full")
    losing = fault("recording.losing", FaultSeverity.WARNING, "messages are missing")
    other = replace(losing, component="battery")
    cleared = replace(losing, active=False)
    now = of(replace(RECORDS, room_s=60), LISTED, nearly, losing, other, cleared)
    assert notes(now) == [
        ("The disk for recordings is nearly full. Look at it", SeverityStyle.WARNING),
        ("Messages are missing. Look at it", SeverityStyle.WARNING),
    ]
    dead = fault("recording.disk", FaultSeverity.ERROR, "nothing can be recorded: it is read-only")
    assert notes(
        of(replace(IDLE, state=RecorderState.FAULTED, last_error="it is read-only"), LISTED, dead)
    ) == [("Nothing can be recorded: it is read-only. Look at it", SeverityStyle.BAD)]


@pytest.mark.parametrize(
    ("why", "words"),
    [
        (RecordingStopReason.DISK, "because the disk has no more room"),
        (RecordingStopReason.ERROR, "by an error of the disk"),
    ],
)
def test_a_recording_that_the_disk_has_ended_is_red_as_long_as_room_is_short(
    why: RecordingStopReason, words: str
) -> None:
    cut = RecordingsView(listed=(replace(ENDED, stop_reason=why),))
    full = replace(IDLE, room_bytes=0)
    now = of(full, cut)
    assert (f"The last recording ended {words}", SeverityStyle.BAD) in notes(now)
    assert now.style is SeverityStyle.BAD
    assert now.tile
    assert now.tile.style is SeverityStyle.BAD
    assert not of(IDLE, cut).notes, "there is room again"
    assert of(replace(RECORDS, room_s=60), cut).style is SeverityStyle.WARNING, "another one runs"


def test_without_a_ring_the_last_seconds_can_not_be_kept() -> None:
    none = replace(IDLE, ring_s=0, presets=(replace(DRIVING, in_ring=False),))
    assert "keeps no ring" in of(none).keep.reason
    assert of(none).record.enabled
    assert of(replace(IDLE, ring_s=0)).keep.reason == "The ring is empty at the moment"


def test_a_role_that_does_not_suffice_bars_every_change_but_no_copy() -> None:
    now = of(IDLE, replace(LISTED, denied="it needs the role operator"))
    (only,) = now.items
    for action in (now.record, now.keep, only.pin, only.delete):
        assert action.reason == "it needs the role operator"
    assert only.export.enabled


def test_what_the_robot_has_yet_to_answer_waits() -> None:
    asked = {
        ChangeRequest(Change.START),
        ChangeRequest(Change.KEEP),
        ChangeRequest(Change.PIN, "one"),
        ChangeRequest(Change.DELETE, "one"),
    }
    now = of(IDLE, replace(LISTED, pending=frozenset(asked)))
    (only,) = now.items
    assert {now.record.reason, now.keep.reason, only.pin.reason, only.delete.reason} == {WAITING}


def test_an_item_says_what_it_is() -> None:
    shown = item(ENDED)
    assert shown.title == "lap 0"
    assert shown.facts.endswith(", 1 min 00 s, 12.3 MB")
    assert (shown.state, shown.style) == ("complete", SeverityStyle.GOOD)
    assert "one" in shown.tip
    assert all(action.enabled for action in (shown.export, shown.pin, shown.delete))


@pytest.mark.parametrize(
    ("kind", "title"),
    [
        (RecordingKind.MANUAL, "driving"),
        (RecordingKind.SNAPSHOT, "Snapshot, driving"),
        (RecordingKind.INCIDENT, "Incident, driving"),
        (RecordingKind.RUN_BUNDLE, "Run bundle, driving"),
    ],
)
def test_an_item_without_a_label_has_a_title(kind: RecordingKind, title: str) -> None:
    assert item(replace(ENDED, label="", kind=kind)).title == title


@pytest.mark.parametrize(
    ("found", "style"),
    [
        (RecordingState.RECOVERED, SeverityStyle.WARNING),
        (RecordingState.FAULTED, SeverityStyle.BAD),
        (RecordingState.UNKNOWN, SeverityStyle.QUIET),
    ],
)
def test_an_item_has_the_style_of_its_state(found: RecordingState, style: SeverityStyle) -> None:
    shown = item(replace(ENDED, state=found, gap_count=2))
    assert (shown.state, shown.style) == (f"{found.value}, 2 gaps", style)


def test_the_recording_that_runs_is_as_long_as_the_status_says() -> None:
    shown = item(RUNNING, RECORDS)
    assert shown.facts.endswith("2 min 05 s, 40.0 MB")
    assert shown.delete.reason == "It is still written: stop it first"
    assert shown.pin.enabled
    assert shown.picture is None


def test_pictures_are_there_or_awaited_or_can_not_be() -> None:
    assert item(ENDED).picture is None
    assert item(ENDED, pictures={"one": b"pixels"}).picture == b"pixels"
    assert item(replace(ENDED, video_frames=0)).picture == b""


def test_what_is_protected_can_not_be_deleted() -> None:
    pinned = item(replace(ENDED, pinned=True))
    assert pinned.pin.text == "Unpin"
    assert pinned.delete.reason == "It is pinned: unpin it first"
    bundle = item(replace(ENDED, kind=RecordingKind.RUN_BUNDLE))
    assert "read-only" in bundle.pin.reason
    assert "read-only" in bundle.delete.reason
    assert bundle.export.enabled


def test_a_copy_that_runs_shows_how_far_it_is() -> None:
    copy = replace(COPY, done=30_000_000, total=100_000_000, rate=ExportRate(2_000_000, 35.0))
    shown = item(ENDED, exports={"one": copy})
    assert (shown.export.text, shown.export.enabled) == ("Cancel export", True)
    assert shown.copied == "30.0 MB of 100.0 MB, 2.0 MB/s, 35 s left"
    assert shown.delete.reason == "It is being exported"
    other = item(ENDED, exports={"two": copy})
    assert other.export.reason == "Another recording is being exported"
    assert item(ENDED, exports={"one": COPY}).copied == "Export begins"
    waits = item(ENDED, exports={"one": replace(copy, text="no robot there")})
    assert waits.copied == "30.0 MB of 100.0 MB, waiting: no robot there"


@pytest.mark.parametrize(
    ("ended", "text", "button", "words"),
    [
        (ExportState.DONE, "there/one: 2 files, verified", "Export", "there/one: 2 files, verified"),
        (
            ExportState.FAILED,
            "it was deleted",
            "Resume export",
            "it was deleted. What was received stays in there/one",
        ),
        (ExportState.CANCELLED, "", "Resume export", "Cancelled. What was received stays in there/one"),
    ],
)
def test_a_copy_that_has_ended_says_how(ended: ExportState, text: str, button: str, words: str) -> None:
    shown = item(ENDED, exports={"one": replace(COPY, state=ended, text=text)})
    assert (shown.export.text, shown.export.enabled, shown.copied) == (button, True, words)


def test_a_recording_without_files_can_not_be_copied() -> None:
    assert item(replace(ENDED, file_count=0, size=0)).export.reason == "It has no files yet"


def test_the_question_before_a_deletion_says_whether_there_is_a_copy() -> None:
    question = deletion_question(item(ENDED))
    assert question.startswith("Delete lap 0 (")
    assert question.endswith("This window has not exported it.")
    done = item(ENDED, exports={"one": replace(COPY, state=ExportState.DONE)})
    assert "It was exported to there/one." in deletion_question(done)


def test_the_list_as_a_whole() -> None:
    assert of(IDLE, RecordingsView()).listed == "The list has not arrived yet"
    assert of(IDLE, RecordingsView(listed=())).listed == "No recordings on the robot"
    assert of(IDLE).listed == "1 recording"
    assert of(IDLE, replace(LISTED, more=True)).listed == "The newest 1 recording; all: robotctl record list"
    now = of(IDLE, RecordingsView(problem="no robot there"))
    assert now.listed == ""
    assert notes(now) == [("The list can't be had: no robot there", SeverityStyle.WARNING)]
