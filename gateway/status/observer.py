"""Turns a series of snapshots into events: what has changed since the last one, in a sentence each."""

from gateway.status.freshness import Freshness
from gateway.status.preview import PreviewState, PreviewView
from gateway.status.snapshot import Snapshot


class Observer:
    """Compares each snapshot with the one before. The first one is the ground and makes no events."""

    def __init__(self) -> None:
        self._conditions: dict[str, str] | None = None

    def observe(self, snapshot: Snapshot) -> list[str]:
        """The events that this snapshot brings."""
        conditions = _conditions(snapshot)
        before = self._conditions
        if before is None:
            self._conditions = conditions
            return []
        # A condition that is not told now (a preview on its way) stands as it was.
        self._conditions = before | conditions
        return [text for key, text in conditions.items() if before.get(key) != text]


def _conditions(snapshot: Snapshot) -> dict[str, str]:
    """One sentence per thing an operator wants to be told of."""
    sources = {
        "odometry": snapshot.odometry.freshness,
        "vision telemetry": snapshot.vision.freshness,
        "detections": snapshot.detections.freshness,
        "battery": snapshot.battery.freshness,
    }
    conditions = {name: f"{name} {_word(freshness)}" for name, freshness in sources.items()}
    conditions["service"] = (
        "preview service connected" if snapshot.preview.service_reachable else "preview service unreachable"
    )
    preview = _preview_sentence(snapshot.preview)
    if preview:
        conditions["preview"] = preview
    return conditions


def _word(freshness: Freshness) -> str:
    if not freshness.available:
        return "never received"
    return "stale" if freshness.stale else "received"


def _preview_sentence(preview: PreviewView) -> str:
    """Empty on the way from one state to another: each retry of a faulted preview would be news."""
    match preview.state:
        case PreviewState.RUNNING:
            profile = preview.profile.value if preview.profile else "?"
            encoder = preview.encoder
            if encoder and encoder.fallback_reason:
                why = f"{encoder.name} instead of {encoder.wanted}: {encoder.fallback_reason}"
                return f"preview running, {profile}, encoder {why}"
            return f"preview running, {profile}"
        case PreviewState.FAULTED:
            return f"preview faulted: {preview.last_error}"
        case PreviewState.DISABLED:
            return "preview off"
        case PreviewState.STARTING | PreviewState.STOPPING:
            return ""
