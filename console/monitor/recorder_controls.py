"""Model of the recording panel: what it says, what can be pressed, and why the rest can't. Pure."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from console.client import Recording, RecordingStatus
from console.client.results import (
    Fault,
    RecorderState,
    RecordingKind,
    RecordingState,
    RecordingStopReason,
)
from console.monitor.bar_items import BarItem
from console.monitor.monitor_state import MonitorState
from console.monitor.recordings_view import Change, ChangeRequest, ExportState, ExportView, RecordingsView
from console.presentation.cloud import copy_text
from console.presentation.formatting import age, joined, plural, size, wall_clock
from console.presentation.preview_switch import Note
from console.presentation.recording import is_written, lost, marks, recorder_mark, recording_state, remarks
from console.presentation.severity_style import FAULT_STYLES, SeverityStyle
from console.presentation.value_style import of_recorder

KEPT_S: Final = 30
"""What the button keeps of the ring."""
NOT_SET_UP: Final = (
    "This robot is not set up for recording: start robot-recorder on it, and set recording.socket in the"
    " gateway's configuration"
)
_NO_STATUS: Final = "No status received yet"
_NO_ANSWER: Final = "The robot does not answer"
WAITING: Final = "Waiting for the robot ..."
"""The only reason that goes by itself."""
_NO_COPY: Final = "This window has not exported it."
_BUSY: Final = {
    RecorderState.UNREACHABLE: "The recorder does not answer. What it records at present goes on",
    RecorderState.RECOVERING: "Recordings that were cut off are being recovered",
    RecorderState.STARTING: "A recording is being opened",
    RecorderState.FINALISING: "A recording is being closed",
}
_STATE_STYLES: Final = {
    RecordingState.RECORDING: SeverityStyle.GOOD,
    RecordingState.COMPLETE: SeverityStyle.GOOD,
    RecordingState.RECOVERED: SeverityStyle.WARNING,
    RecordingState.FAULTED: SeverityStyle.BAD,
}
_CUT_SHORT: Final = {
    RecordingStopReason.DISK: "because the disk has no more room",
    RecordingStopReason.ERROR: "by an error of the disk",
}
_BEGAN: Final = "%d %b %H:%M %Z"
_COMPONENT: Final = "recording"
_DISK: Final = "recording.disk"
"""Component and ID of faults (docs/recording.md)."""
_MS_PER_S: Final = 1000
_S_PER_MIN: Final = 60


@dataclass(frozen=True, slots=True)
class Action:
    """A button.

    Args:
        text: on it.
        reason: why it can't be pressed; empty where it can.
    """

    text: str
    reason: str = ""

    @property
    def enabled(self) -> bool:
        """Whether it can be pressed."""
        return not self.reason


@dataclass(frozen=True, slots=True)
class PresetChoice:
    """What can be recorded.

    Args:
        name: as the robot names it.
        meaning: for people.
    """

    name: str
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingItem:
    """A recording in the list.

    Args:
        recording: as the robot lists it; the one that runs as its status says.
        title: its name for people.
        facts: begin, length, size.
        state: its state and what is remarkable, in words.
        style: of the state.
        tip: all of it.
        picture: pixels; empty where there are none; None while they are not known.
        export, pin, delete: its buttons.
        copy: its copy on this computer; None without one.
        copied: how far the copy is, or how it ended; empty without one.
    """

    recording: Recording
    title: str
    facts: str
    state: str
    style: SeverityStyle
    tip: str
    picture: bytes | None
    export: Action
    pin: Action
    delete: Action
    copy: ExportView | None = None
    copied: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderControls:
    """The panel at one moment.

    Args:
        absent: why there is no recorder; empty where there is one, or no status yet.
        mark, style: the recorder's state.
        running: what is recorded: length, size, name.
        room: how long there is room, at which rate.
        notes: what is wrong, the worst first.
        presets: what can be recorded.
        on: whether a recording runs: the button stops it.
        running_id: that recording; empty without one.
        record, keep: the buttons.
        items: the list, the newest first.
        listed: about the list as a whole.
        tile: what lies over the picture; None without a recorder.
    """

    absent: str = ""
    mark: str = ""
    style: SeverityStyle = SeverityStyle.QUIET
    running: str = ""
    room: str = ""
    notes: tuple[Note, ...] = ()
    presets: tuple[PresetChoice, ...] = ()
    on: bool = False
    running_id: str = ""
    record: Action = Action("Record", _NO_STATUS)
    keep: Action = Action(f"Keep the last {KEPT_S} s", _NO_STATUS)
    items: tuple[RecordingItem, ...] = ()
    listed: str = ""
    tile: BarItem | None = None


def deletion_question(item: RecordingItem) -> str:
    """Returns what is asked before a recording is deleted."""
    exported = bool(item.copy and item.copy.state is ExportState.DONE)
    copied = f"It was exported to {item.copy.folder}." if item.copy and exported else _NO_COPY
    return f"Delete {item.title} ({item.facts}) from the robot's disk? {copied}"


def recorder_controls(
    state: MonitorState, view: RecordingsView, preset: str, now_s: float, *, with_items: bool = True
) -> RecorderControls:
    """Returns the panel.

    Args:
        state: the latest.
        view: of the recordings.
        preset: the one that is chosen; empty for the first.
        now_s: on the monotonic clock.
        with_items: whether the list can be seen; without it most of the work is saved.
    """
    if state.snapshot is None:
        return RecorderControls()
    status = state.snapshot.status.recording
    if status is None:
        return RecorderControls(absent=NOT_SET_UP)
    lost = _NO_ANSWER if state.outdated(now_s) else ""
    silent = lost or (_BUSY[status.state] if status.state is RecorderState.UNREACHABLE else "")
    barred = lost or _BUSY.get(status.state, "")
    listed = (view.listed or ()) if with_items else ()
    mark, style = recorder_mark(status)
    notes = () if lost else tuple(_notes(state.snapshot.status.faults, status, view))
    if lost:
        mark, style = f"last known: {mark}", SeverityStyle.WARNING
    elif any(note.style is SeverityStyle.BAD for note in notes):
        style = SeverityStyle.BAD
    return RecorderControls(
        mark=mark.upper(),
        style=style,
        running=_running(status),
        room=_room(status, preset),
        notes=notes,
        presets=tuple(_presets(status)),
        on=bool(status.recording_id),
        running_id=status.recording_id,
        record=_record(status, view, barred),
        keep=Action(f"Keep the last {KEPT_S} s", _why_not_kept(status, view, barred)),
        items=tuple(_item(each, status, view, silent, barred) for each in listed),
        listed=_listed(view),
        tile=BarItem(_word(status), _tile_room(status), style, joined(mark, *(note.text for note in notes))),
    )


def _running(status: RecordingStatus) -> str:
    if not status.recording_id:
        return joined(
            "Nothing is recorded",
            plural(status.snapshots_pending, "snapshot") + " pending" if status.snapshots_pending else "",
        )
    return joined(
        age(status.elapsed_ms),
        size(status.size),
        "with video" if status.video else "without video",
        status.label or status.preset,
        lost(status),
    )


def _room(status: RecordingStatus, preset: str) -> str:
    """Returns the room in time: at the present rate, or at that of the chosen preset while nothing runs."""
    if status.recording_id and status.room_s is not None:
        return f"Room for {_minutes(status.room_s)} at {size(status.bytes_per_s)}/s"
    chosen = next((each for each in status.presets if each.name == preset), None)
    chosen = chosen or next(iter(status.presets), None)
    room = f"Room for {size(status.room_bytes)}"
    if chosen is None or not chosen.bytes_per_minute:
        return room
    return f"{room}: {_minutes(status.room_bytes * _S_PER_MIN / chosen.bytes_per_minute)} of {chosen.name}"


def _minutes(seconds: float) -> str:
    """Returns a time in minutes, from two hours on with hours: nothing that changes each second."""
    if seconds < 2 * _S_PER_MIN:
        return f"{seconds:.0f} s"
    if seconds < 2 * _S_PER_MIN**2:
        return f"{seconds // _S_PER_MIN:.0f} min"
    return age(round(seconds * _MS_PER_S))


def _word(status: RecordingStatus) -> str:
    return "REC" if status.state is RecorderState.RECORDING else status.state.value.upper()


def _tile_room(status: RecordingStatus) -> str:
    if status.recording_id and status.room_s is not None:
        return f"room {_minutes(status.room_s)}"
    return f"room {size(status.room_bytes)}"


def _notes(faults: tuple[Fault, ...], status: RecordingStatus, view: RecordingsView) -> Iterator[Note]:
    active = [fault for fault in faults if fault.active and fault.component == _COMPONENT]
    for fault in active:
        text = ". ".join(filter(None, (fault.message, fault.remedy)))
        yield Note(text[:1].upper() + text[1:], FAULT_STYLES[fault.severity])
    if status.last_error and not any(status.last_error in fault.message for fault in active):
        yield Note(status.last_error, SeverityStyle.BAD if _is_faulted(status) else SeverityStyle.WARNING)
    room = of_recorder(status)
    disk = any(fault.id == _DISK for fault in active)
    if room.style is SeverityStyle.WARNING and not disk:
        yield Note(
            f"{room.word.capitalize()}: export recordings to this computer and delete them", room.style
        )
    if (disk or room.style is not SeverityStyle.GOOD) and (why := _cut_short(status, view)):
        yield Note(f"The last recording ended {why}", SeverityStyle.BAD)
    if view.problem:
        yield Note(f"The list can't be had: {view.problem}", SeverityStyle.WARNING)
    if view.denied:
        yield Note(view.denied, SeverityStyle.QUIET)


def _cut_short(status: RecordingStatus, view: RecordingsView) -> str:
    """Returns why the last recording ended, where the disk ended it and no other one runs."""
    manual = (each for each in view.listed or () if each.kind is RecordingKind.MANUAL)
    newest = None if status.recording_id else next(manual, None)
    return _CUT_SHORT.get(newest.stop_reason, "") if newest else ""


def _presets(status: RecordingStatus) -> Iterator[PresetChoice]:
    for each in status.presets:
        rate = f"{size(each.bytes_per_minute)} a minute" if each.bytes_per_minute else "not measured yet"
        yield PresetChoice(
            each.name, joined(each.description, "with video" if each.with_video else "without video", rate)
        )


def _record(status: RecordingStatus, view: RecordingsView, barred: str) -> Action:
    waits = {each.change for each in view.pending} & {Change.START, Change.STOP}
    pending = WAITING if waits else ""
    if status.recording_id:
        return Action("Stop recording", barred or view.denied or pending)
    return Action("Record", barred or view.denied or pending or _faulted(status))


def _is_faulted(status: RecordingStatus) -> bool:
    return status.state is RecorderState.FAULTED


def _faulted(status: RecordingStatus) -> str:
    """Returns why nothing can be recorded; empty where it can."""
    return (status.last_error or "The disk can't be written") if _is_faulted(status) else ""


def _why_not_kept(status: RecordingStatus, view: RecordingsView, barred: str) -> str:
    if barred or view.denied:
        return barred or view.denied
    if not status.ring_s:
        if any(each.in_ring for each in status.presets):
            return "The ring is empty at the moment"
        return "This robot keeps no ring of the last seconds: set ring in the recorder's configuration"
    return _faulted(status) or (WAITING if ChangeRequest(Change.KEEP) in view.pending else "")


def _item(
    each: Recording, status: RecordingStatus, view: RecordingsView, silent: str, barred: str
) -> RecordingItem:
    """Returns an item; `silent` is why nothing can be read, `barred` why nothing can be changed."""
    runs = each.id == status.recording_id
    duration_ms, count = (status.elapsed_ms, status.size) if runs else (each.duration_ms, each.size)
    copy = view.exports.get(each.id)
    return RecordingItem(
        recording=each,
        title=_title(each),
        facts=joined(wall_clock(each.started_unix_ms, form=_BEGAN), age(duration_ms), size(count)),
        state=joined(recording_state(each), copy_text(each.copy, each.size), marks(each)),
        tip=f"{each.id}, {wall_clock(each.started_unix_ms)}. {joined(recording_state(each), remarks(each))}",
        style=_STATE_STYLES.get(each.state, SeverityStyle.QUIET),
        picture=view.pictures.get(each.id) if each.video_frames or is_written(each) else b"",
        export=_export(each, view, copy, silent),
        pin=Action("Unpin" if each.pinned else "Pin", _why_not_pinned(each, view, barred)),
        delete=Action("Delete ...", _why_not_deleted(each, view, barred, runs=runs)),
        copy=copy,
        copied=_copied(copy) if copy else "",
    )


def _title(each: Recording) -> str:
    if each.kind is RecordingKind.MANUAL:
        return each.label or each.preset or each.id
    kind = each.kind.value.replace("-", " ").capitalize()
    return joined(kind, each.label or each.preset)


def _export(each: Recording, view: RecordingsView, copy: ExportView | None, silent: str) -> Action:
    if copy and copy.state is ExportState.RUNNING:
        return Action("Cancel export")
    unfinished = copy and copy.state in (ExportState.FAILED, ExportState.CANCELLED)
    other = "Another recording is being exported" if view.exporting else ""
    empty = "" if each.file_count or each.size else "It has no files yet"
    return Action("Resume export" if unfinished else "Export", silent or other or empty)


def _why_not_pinned(each: Recording, view: RecordingsView, barred: str) -> str:
    read_only = "The robot's own experiments are read-only" if each.kind is RecordingKind.RUN_BUNDLE else ""
    pending = WAITING if ChangeRequest(Change.PIN, each.id) in view.pending else ""
    return barred or view.denied or read_only or pending


def _why_not_deleted(each: Recording, view: RecordingsView, barred: str, *, runs: bool) -> str:
    if barred or view.denied:
        return barred or view.denied
    if each.kind is RecordingKind.RUN_BUNDLE:
        return "The robot's own experiments are read-only"
    if runs or is_written(each):
        return "It is still written: stop it first"
    if each.pinned:
        return "It is pinned: unpin it first"
    if view.exporting == each.id:
        return "It is being exported"
    return WAITING if ChangeRequest(Change.DELETE, each.id) in view.pending else ""


def _copied(copy: ExportView) -> str:
    if copy.state is ExportState.DONE:
        return copy.text
    if copy.state is ExportState.FAILED:
        return f"{copy.text}. What was received stays in {copy.folder}"
    had = f"{size(copy.done)} of {size(copy.total)}" if copy.total else ""
    if copy.state is ExportState.CANCELLED:
        return f"{joined('Cancelled', had)}. What was received stays in {copy.folder}"
    left_s = copy.rate.left_s
    return joined(
        had or "Export begins",
        f"waiting: {copy.text}" if copy.text else "",
        f"{size(round(copy.rate.bytes_per_s))}/s" if copy.rate.bytes_per_s and not copy.text else "",
        f"{_minutes(left_s)} left" if left_s is not None and not copy.text else "",
    )


def _listed(view: RecordingsView) -> str:
    if view.listed is None:
        return "" if view.problem else "The list has not arrived yet"
    if not view.listed:
        return "No recordings on the robot"
    counted = plural(len(view.listed), "recording")
    return f"The newest {counted}; all: robotctl record list" if view.more else counted
