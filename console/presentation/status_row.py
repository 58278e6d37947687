"""How a status is looked at, and the row that a part of it becomes: its state, its age, its text."""

from dataclasses import dataclass
from typing import Final

from console.client import results
from console.client.results import Freshness
from console.presentation.formatting import UNKNOWN, age, joined
from console.presentation.severity_style import FRESHNESS_STYLES, SeverityStyle
from console.presentation.value_style import GOOD, Judgement

_MARKS: Final = {Freshness.FRESH: "fresh", Freshness.STALE: "STALE", Freshness.MISSING: "no data"}
_REMARKABLE_AGE_MS: Final = 2000


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table."""

    label: str
    mark: str
    """One word: "fresh", "STALE", "no data", "RUNNING" ..."""
    style: SeverityStyle
    text: str
    age: str = ""
    remedy: str = ""
    """What to do about a fault, where the text does not say it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """How a part of a status is looked at.

    Args:
        compact: Whether texts must be short.
        silent_ms: Time since the status was received; ages count on by it.
        outdated: Whether that is so long that fresh values count as stale.
    """

    compact: bool = False
    silent_ms: int = 0
    outdated: bool = False

    def age(self, age_ms: int | None) -> str:
        """Returns an age as of now; empty in the compact density where there is none."""
        if age_ms is None:
            return "" if self.compact else UNKNOWN
        return age(age_ms + self.silent_ms)

    def label(self, label: str) -> str:
        """Returns the label as the density writes it."""
        return label.capitalize() if self.compact else label

    def state(self, label: str, state: str, style: SeverityStyle, text: str) -> Row:
        """Returns the row of a state, which reads "last known" once the status is outdated."""
        return self.present(label, state.upper(), style, text)

    def present(self, label: str, mark: str, style: SeverityStyle, text: str, age: str = "") -> Row:
        """Returns the row of what is so now; once the status is outdated it reads that it was."""
        if self.outdated:
            last = joined(f"last known: {mark}", text)
            return Row(label, _MARKS[Freshness.STALE], SeverityStyle.WARNING, last, age)
        return Row(label, mark, style, text, age)

    def measured(self, label: str, sample: results.Sample, text: str, found: Judgement = GOOD) -> Row:
        """Returns the row of a measured part: marked by its freshness, empty while it is missing.

        Args:
            label: of the row.
            sample: the part.
            text: its values.
            found: how good these are, which counts while they are fresh.
        """
        freshness = sample.freshness
        if freshness is Freshness.FRESH and self.outdated:
            freshness = Freshness.STALE
        text = text if sample.available else ""
        fresh = freshness is Freshness.FRESH
        return Row(
            self.label(label),
            (fresh and found.word) or _MARKS[freshness],
            found.style if fresh else FRESHNESS_STYLES[freshness],
            unbroken(text) if self.compact else text,
            "" if fresh and self._is_unremarkable(sample.age_ms) else self.age(sample.age_ms),
        )

    def _is_unremarkable(self, age_ms: int | None) -> bool:
        """Whether an age says no more than "fresh" does, where texts must be short."""
        return self.compact and (age_ms or 0) + self.silent_ms < _REMARKABLE_AGE_MS


@dataclass(frozen=True, slots=True)
class View(Look):
    """A whole status, and how it is looked at.

    Args:
        status: The newest one.
        detections: The newest ones; None where the view has none.
    """

    status: results.SystemStatus
    detections: results.Detections | None = None


def unbroken(text: str) -> str:
    """Returns the text with line breaks possible behind commas only, never between a number and its unit."""
    return ", ".join(part.replace(" ", "\u00a0") for part in text.split(", "))
