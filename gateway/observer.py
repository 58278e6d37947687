"""Compares each snapshot with the previous ones: tracks the faults and derives the events."""

from collections.abc import Iterator
from typing import Final

from gateway.status.cloud_events import CloudEvents
from gateway.status.event import (
    EncoderFallback,
    Event,
    FaultCleared,
    FaultRaised,
    PreviewChanged,
)
from gateway.status.fault import Fault, Severity
from gateway.status.faults.rules import FaultRules, conditions
from gateway.status.faults.tracker import Changes, FaultTracker
from gateway.status.mode_events import ModeEvents
from gateway.status.preview import Encoder, PreviewState, PreviewView, Profile, live_camera
from gateway.status.recording_events import RecordingEvents
from gateway.status.snapshot import Snapshot
from gateway.status.sources import MODE

_SETTLED: Final = frozenset({PreviewState.DISABLED, PreviewState.RUNNING, PreviewState.FAULTED})
"""STARTING and STOPPING lead from one of these to another and are no events of their own."""
_PREVIEW: Final = "preview"


class Observer:
    """Derives the events from the snapshots; the only writer of the fault tracker.

    The first snapshot is the baseline: it raises faults but no other events.

    Args:
        tracker: keeps the faults.
        rules: parameters of the fault rules.
    """

    def __init__(self, tracker: FaultTracker, rules: FaultRules) -> None:
        self._tracker = tracker
        self._rules = rules
        self._started_s: float | None = None
        self._preview: tuple[PreviewState, Profile | None, str] | None = None
        self._encoder: Encoder | None = None
        self._modes = ModeEvents()
        self._recordings = RecordingEvents()
        self._cloud = CloudEvents()

    def observe(self, snapshot: Snapshot) -> list[Event]:
        """Returns the events that this snapshot brings, in order."""
        first = self._started_s is None
        if self._started_s is None:
            self._started_s = snapshot.at_s
        up_s = snapshot.at_s - self._started_s
        present = conditions(snapshot, self._rules, self._tracker.active_ids, up_s)
        faults = list(_fault_events(self._tracker.update(present, snapshot.at_s)))
        others = [
            *self._preview_events(snapshot.preview),
            *self._mode_events(snapshot),
            *(self._recordings.take(snapshot.recorder) if snapshot.recorder else ()),
            *self._cloud_events(snapshot),
        ]
        return faults if first else [*faults, *others]

    def _preview_events(self, preview: PreviewView) -> Iterator[Event]:
        encoder = preview.encoder
        if encoder is not None and encoder != self._encoder:
            self._encoder = encoder
            if encoder.fallback_reason:
                yield _fallback(encoder)
        if preview.state not in _SETTLED:
            return
        # While the preview is off, its profile is only that of the next start.
        running = preview.state is PreviewState.RUNNING
        live = live_camera(preview.cameras)
        if running and live is None and preview.cameras:
            return  # A fallback is on its way; the camera that failed is a fault of its own.
        settled = (preview.state, preview.profile if running else None, live.name if running and live else "")
        if settled != self._preview:
            self._preview = settled
            yield _preview_changed(preview)

    def _cloud_events(self, snapshot: Snapshot) -> Iterator[Event]:
        if snapshot.cloud:
            yield from self._cloud.take(snapshot.cloud, snapshot.recorder, snapshot.at_s)

    def _mode_events(self, snapshot: Snapshot) -> Iterator[Event]:
        value = snapshot[MODE].value
        yield from self._modes.take(value.name if value else "", snapshot.at_s)


def _fault_events(changes: Changes) -> Iterator[Event]:
    for fault in changes.raised:
        yield _raised(fault, f"{fault.condition.severity.value}: {fault.condition.message}")
    for fault in changes.worsened:
        yield _raised(fault, f"{fault.condition.severity.value} now: {fault.condition.message}")
    for fault in changes.cleared:
        sentence = f"cleared: {fault.condition.message}"
        yield Event(Severity.INFO, fault.condition.component, sentence, FaultCleared(fault), sentence)


def _raised(fault: Fault, sentence: str) -> Event:
    condition = fault.condition
    return Event(condition.severity, condition.component, condition.message, FaultRaised(fault), sentence)


def _preview_changed(preview: PreviewView) -> Event:
    if preview.state is PreviewState.FAULTED:
        # Without a sentence: the overlay already has the one of the fault.
        faulted = PreviewChanged(preview.state, preview.profile, preview.last_error)
        return Event(Severity.ERROR, _PREVIEW, f"preview faulted: {preview.last_error}", faulted)
    sentence, live = "preview off", live_camera(preview.cameras)
    if preview.state is PreviewState.RUNNING:
        sentence = f"preview running, {preview.profile.value if preview.profile else '?'}"
        if live and len(preview.cameras) > 1:
            sentence += f", camera {live.name}"
    running = preview.state is PreviewState.RUNNING
    changed = PreviewChanged(preview.state, preview.profile, "", live.name if running and live else "")
    return Event(Severity.INFO, _PREVIEW, sentence, changed, sentence)


def _fallback(encoder: Encoder) -> Event:
    """Without a sentence: the overlay already has the one of the fault, which also is the warning."""
    message = f"{encoder.name} encodes instead of {encoder.wanted}: {encoder.fallback_reason}"
    detail = EncoderFallback(encoder.name, encoder.wanted, encoder.fallback_reason)
    return Event(Severity.INFO, _PREVIEW, message, detail)
