"""Derives the events of the fleet from the bridge's reports. Pure."""

from collections import OrderedDict
from collections.abc import Iterator
from typing import Final, TypeVar

from common.token_bucket import TokenBucket
from gateway.status.cloud import CloudState, CloudView, CopyReport, RecordingCopyState
from gateway.status.event import CloudChanged, Event, RecordingCopyChanged
from gateway.status.fault import Severity
from gateway.status.recording import RecorderView

_T = TypeVar("_T")

_COMPONENT: Final = "fleet"
SETTLED_S: Final = 5.0
"""A state of the connection that has lasted so long is an event."""
REMEMBERED: Final = 1024
"""Recordings of which something is remembered."""
BURST: Final = 64
"""Events of copies at once, as many as a report has copies; then one a second. The others come later."""
_SENTENCES: Final = {
    CloudState.CONNECTED: (Severity.INFO, "connected to the fleet's hub"),
    CloudState.OFFLINE: (Severity.INFO, "the fleet's hub is not reached"),
    CloudState.REFUSED: (Severity.ERROR, "the fleet's hub refuses this robot's credential"),
    CloudState.FAULTED: (Severity.ERROR, "the robot's bridge to its fleet can't work"),
    CloudState.UNREACHABLE: (Severity.WARNING, "the robot's bridge to its fleet does not answer"),
}
_FAULTS: Final = frozenset({CloudState.REFUSED, CloudState.FAULTED, CloudState.UNREACHABLE})
"""The overlay has the sentence of the fault already."""
_ENDS: Final = frozenset({RecordingCopyState.VERIFIED, RecordingCopyState.FAILED})


class CloudEvents:
    """Compares each view with those before. The first settled state and the first copies are no events.

    Nor is a copy that ended before the first report, which has room for few: others come later. One that was
    seen on its way did not; of another the bridge says how long ago it ended, if it can.
    """

    def __init__(self) -> None:
        self._state: CloudState | None = None
        self._since_s = 0.0
        self._settled: CloudState | None = None
        """None before the first."""
        self._ends: OrderedDict[str, RecordingCopyState] = OrderedDict()
        """The newest event of a recording's copy."""
        self._on_their_way: OrderedDict[str, None] = OrderedDict()
        """Recordings whose copy had not ended when it was seen last."""
        self._began_s: float | None = None
        """When the first report was seen."""
        self._bucket = TokenBucket(BURST, 0.0)

    def take(self, view: CloudView, recorder: RecorderView | None, now_s: float) -> Iterator[Event]:
        """Yields the events that a view brings.

        Args:
            view: of this instant.
            recorder: knows the labels of recordings; None where the robot is not set up for recording.
            now_s: monotonic seconds.
        """
        status = view.status(now_s)
        if status.state is not self._state:
            self._state, self._since_s = status.state, now_s
        if status.state is not self._settled and now_s - self._since_s >= SETTLED_S:
            before, self._settled = self._settled, status.state
            if before is not None:
                yield _changed(status.state, status.last_error)
        if report := view.newest:
            yield from self._copies(report.copies, recorder, now_s)

    def _copies(
        self, copies: tuple[CopyReport, ...], recorder: RecorderView | None, now_s: float
    ) -> Iterator[Event]:
        first = self._began_s is None
        began_s = self._began_s = now_s if self._began_s is None else self._began_s
        for each in copies:
            state, known = each.copy.state, self._ends.get(each.recording_id)
            if state not in _ENDS:
                _remember(self._on_their_way, each.recording_id, None)
                continue
            if state is known:
                continue
            ended_since = each.since_s is not None and each.since_s >= began_s
            if not first and (ended_since or each.recording_id in self._on_their_way):
                if not self._bucket.take(now_s, capacity=BURST, refill_per_s=1.0):
                    return
                yield _copied(each, _label(recorder, each.recording_id))
            self._on_their_way.pop(each.recording_id, None)
            _remember(self._ends, each.recording_id, state)


def _remember(recordings: OrderedDict[str, _T], recording_id: str, what: _T) -> None:
    """Keeps something of a recording, and forgets the oldest beyond REMEMBERED."""
    recordings[recording_id] = what
    recordings.move_to_end(recording_id)
    if len(recordings) > REMEMBERED:
        recordings.popitem(last=False)


def _changed(state: CloudState, last_error: str) -> Event:
    severity, sentence = _SENTENCES[state]
    message = f"{sentence}: {last_error}" if last_error else sentence
    return Event(
        severity,
        _COMPONENT,
        message,
        CloudChanged(state, last_error),
        None if state in _FAULTS else sentence,
    )


def _copied(report: CopyReport, label: str) -> Event:
    copy, named = report.copy, f"{label} ({report.recording_id})" if label else report.recording_id
    detail = RecordingCopyChanged(report.recording_id, label, copy)
    if copy.state is RecordingCopyState.VERIFIED:
        sentence = f"recording {named} is copied to the fleet's store, verified"
        return Event(Severity.INFO, _COMPONENT, sentence, detail, sentence)
    why = f": {copy.reason}" if copy.reason else ""
    message = f"recording {named} could not be copied to the fleet's store{why}; it is tried again"
    return Event(Severity.WARNING, _COMPONENT, message, detail)


def _label(recorder: RecorderView | None, recording_id: str) -> str:
    if recorder is None or recorder.report is None:
        return ""
    return next((each.label for each in recorder.report.value.ended if each.id == recording_id), "")
