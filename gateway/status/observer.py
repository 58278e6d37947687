"""Looks at one snapshot after the other: keeps the book of faults, and says what is news."""

from collections.abc import Iterator
from typing import Final

from gateway.status.event import EncoderFallback, ModeChanged, News, PreviewChanged
from gateway.status.faults.book import FaultBook
from gateway.status.faults.fault import Severity
from gateway.status.faults.rules import FaultRules, conditions
from gateway.status.faults.sentences import fault_news
from gateway.status.preview import Encoder, PreviewState, PreviewView, Profile
from gateway.status.snapshot import Snapshot

_SETTLED: Final = frozenset({PreviewState.DISABLED, PreviewState.RUNNING, PreviewState.FAULTED})
"""A preview on its way from one of these to another is as it was."""
_PREVIEW: Final = "preview"


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
        self._preview: tuple[PreviewState, Profile | None] | None = None
        self._encoder: Encoder | None = None
        self._mode = ""

    def observe(self, snapshot: Snapshot) -> list[News]:
        """What this snapshot brings."""
        first = self._started_s is None
        if self._started_s is None:
            self._started_s = snapshot.at_s
        up_s = snapshot.at_s - self._started_s
        found = conditions(snapshot, self._rules, self._book.active_ids, up_s)
        news = list(fault_news(self._book.update(found, snapshot.at_s)))
        others = [*self._of_preview(snapshot.preview), *self._of_mode(snapshot)]
        return news if first else [*news, *others]

    def _of_preview(self, preview: PreviewView) -> Iterator[News]:
        encoder = preview.encoder
        if encoder is not None and encoder != self._encoder:
            self._encoder = encoder
            if encoder.fallback_reason:
                yield _fallback(encoder)
        if preview.state not in _SETTLED:
            return
        # The profile of a preview that is off is that of the next one: no news.
        settled = (preview.state, preview.profile if preview.state is PreviewState.RUNNING else None)
        if settled != self._preview:
            self._preview = settled
            yield _preview_news(preview)

    def _of_mode(self, snapshot: Snapshot) -> Iterator[News]:
        mode = snapshot.mode.value.name if snapshot.mode.value else ""
        if mode != self._mode:
            self._mode = mode
            sentence = f"robot mode: {mode}"
            yield News(Severity.INFO, "mission", sentence, ModeChanged(mode), sentence)


def _preview_news(preview: PreviewView) -> News:
    detail = PreviewChanged(preview.state, preview.profile, "")
    match preview.state:
        case PreviewState.RUNNING:
            words = f"preview running, {preview.profile.value if preview.profile else '?'}"
        case PreviewState.FAULTED:
            # The book of faults tells it on the overlay.
            faulted = PreviewChanged(preview.state, preview.profile, preview.last_error)
            return News(Severity.ERROR, _PREVIEW, f"preview faulted: {preview.last_error}", faulted)
        case _:
            words = "preview off"
    return News(Severity.INFO, _PREVIEW, words, detail, words)


def _fallback(encoder: Encoder) -> News:
    """As a fault it is told on the overlay already."""
    words = f"{encoder.name} encodes instead of {encoder.wanted}: {encoder.fallback_reason}"
    detail = EncoderFallback(encoder.name, encoder.wanted, encoder.fallback_reason)
    return News(Severity.WARNING, _PREVIEW, words, detail)
