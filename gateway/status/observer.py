"""Looks at one snapshot after the other: keeps the book of faults, and says what is news."""

from gateway.status.faults.book import FaultBook
from gateway.status.faults.rules import FaultRules, conditions
from gateway.status.faults.sentences import sentences
from gateway.status.preview import PreviewState, PreviewView
from gateway.status.snapshot import Snapshot


class Observer:
    """The only one who writes into the book. The first snapshot is the ground of all news.

    Args:
        book: where faults are kept.
        rules: what counts as a fault.
    """

    def __init__(self, book: FaultBook, rules: FaultRules) -> None:
        self._book = book
        self._rules = rules
        self._started_s: float | None = None
        self._preview = self._mode = ""

    def observe(self, snapshot: Snapshot) -> list[str]:
        """The events that this snapshot brings, a sentence each."""
        first = self._started_s is None
        if self._started_s is None:
            self._started_s = snapshot.at_s
        up_s = snapshot.at_s - self._started_s
        found = conditions(snapshot, self._rules, self._book.active_ids, up_s)
        news = list(sentences(self._book.update(found, snapshot.at_s)))
        # A preview on its way is as it was.
        preview = _preview_sentence(snapshot.preview) or self._preview
        if preview != self._preview and not first:
            news.append(preview)
        self._preview = preview
        mode = snapshot.mode.value.name if snapshot.mode.value else ""
        if mode != self._mode and not first:
            news.append(f"robot mode: {mode}")
        self._mode = mode
        return news


def _preview_sentence(preview: PreviewView) -> str:
    """Empty on the way from one state to another, and for what the book of faults tells."""
    match preview.state:
        case PreviewState.RUNNING:
            return f"preview running, {preview.profile.value if preview.profile else '?'}"
        case PreviewState.DISABLED:
            return "preview off"
        case PreviewState.STARTING | PreviewState.STOPPING | PreviewState.FAULTED:
            return ""
