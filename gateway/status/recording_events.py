"""Derives the events of recording from the recorder's reports. Pure."""

from collections.abc import Iterator
from typing import Final

from gateway.status.event import Event, RecordingChanged
from gateway.status.fault import Severity
from gateway.status.recording import (
    SNAPSHOTS,
    RecorderReport,
    RecorderStatus,
    RecorderView,
    RecordingBrief,
    RecordingChange,
    RecordingKind,
    RecordingStopReason,
)

_COMPONENT: Final = "recording"
_LOSS_SPACING_S: Final = 10.0
"""Losses less than this apart are one event."""
_SEVERITIES: Final = {
    RecordingStopReason.DISK: Severity.ERROR,
    RecordingStopReason.ERROR: Severity.ERROR,
    RecordingStopReason.INTERRUPTED: Severity.WARNING,
}
"""Of an end by this reason; INFO for the others."""
_Lost = tuple[int, int]
"""Messages as far as they were counted, and gaps of unknown size."""
_NOTHING: Final[_Lost] = (0, 0)


class RecordingEvents:
    """Compares each report with the one before. The first is the baseline, and brings no events."""

    def __init__(self) -> None:
        self._ended: frozenset[str] | None = None
        """IDs of the recordings that had ended; None before the first report."""
        self._running = ""
        self._lost = _NOTHING
        self._lost_s: float | None = None
        """When the newest loss was reported, as of an event or of one that was left out."""

    def take(self, view: RecorderView) -> Iterator[Event]:
        """Yields the events that a view brings, the oldest first."""
        if view.report is None or not view.reachable:
            return
        report, before = view.report.value, self._ended
        self._ended = frozenset(each.id for each in report.ended)
        started = self._take_running(report.status)
        if before is None:
            self._lost = _lost(report.status)
            return
        for each in reversed(report.ended):
            if each.id not in before and each.kind is not RecordingKind.RUN_BUNDLE:
                yield _end(each)
        if started:
            yield _start(report.status)
        yield from self._losses(report, view.report.at_s)

    def _take_running(self, status: RecorderStatus) -> bool:
        """Returns whether another recording runs than before."""
        started = bool(status.recording_id) and status.recording_id != self._running
        if status.recording_id != self._running:
            self._running, self._lost = status.recording_id, _NOTHING
        return started

    def _losses(self, report: RecorderReport, now_s: float) -> Iterator[Event]:
        status = report.status
        before, self._lost = self._lost, _lost(status)
        if not status.recording_id or not _exceeds(self._lost, before):
            return
        recent = self._lost_s is not None and now_s - self._lost_s < _LOSS_SPACING_S
        self._lost_s = now_s
        if not recent:
            sentence = f"{_named(status.recording_id, status.label)} loses messages: {_amount(self._lost)}"
            yield _event(
                Severity.WARNING,
                sentence,
                RecordingChanged(
                    RecordingChange.LOSS,
                    status.recording_id,
                    status.label,
                    messages_lost=status.messages_lost,
                    uncounted_gaps=status.uncounted_gaps,
                ),
            )


def _lost(status: RecorderStatus) -> _Lost:
    return status.messages_lost or 0, status.uncounted_gaps


def _exceeds(lost: _Lost, before: _Lost) -> bool:
    return any(now > then for now, then in zip(lost, before, strict=True))


def _amount(lost: _Lost) -> str:
    messages, gaps = lost
    uncounted = f"{gaps} gap{'' if gaps == 1 else 's'} of unknown size"
    if not gaps:
        return f"{messages} so far"
    return f"{messages} so far, and {uncounted}" if messages else f"{uncounted} so far"


def _start(status: RecorderStatus) -> Event:
    return _event(
        Severity.INFO,
        f"{_named(status.recording_id, status.label)} started, preset {status.preset}",
        RecordingChanged(
            RecordingChange.STARTED,
            status.recording_id,
            status.label,
            messages_lost=status.messages_lost,
            uncounted_gaps=status.uncounted_gaps,
        ),
    )


def _end(brief: RecordingBrief) -> Event:
    is_snapshot = brief.kind in SNAPSHOTS
    why = brief.stop_reason
    whole = is_snapshot and why in (None, RecordingStopReason.REQUESTED, RecordingStopReason.LIMIT)
    word = brief.kind.value if is_snapshot and brief.kind else "recording"
    named = _named(brief.id, brief.label, word)
    text = f"{named} is complete" if whole else f"{named} ended: {why.value if why else 'no reason given'}"
    change = RecordingChange.SNAPSHOT_COMPLETE if whole else RecordingChange.ENDED
    severity = _SEVERITIES.get(why, Severity.INFO) if why else Severity.INFO
    detail = RecordingChanged(
        change,
        brief.id,
        brief.label,
        brief.kind,
        brief.state,
        why,
        brief.messages_lost,
        brief.uncounted_gaps,
    )
    return _event(severity, text, detail)


def _named(recording_id: str, label: str, word: str = "recording") -> str:
    return f"{word} {label} ({recording_id})" if label else f"{word} {recording_id}"


def _event(severity: Severity, sentence: str, detail: RecordingChanged) -> Event:
    return Event(severity, _COMPONENT, sentence, detail, sentence)
