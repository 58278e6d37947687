"""Faults of the texts that the configuration names: those to which it gives a severity."""

import re
from collections.abc import Iterator
from typing import Final

from gateway.status.fault import Condition, Fault, Severity
from gateway.status.freshness import Sample
from gateway.status.meaning import TextMeaning
from gateway.status.sources import SourceSpec
from gateway.status.values import Text

_OTHER: Final = "other"
_LONGEST_SLUG: Final = 40


def text_conditions(
    spec: SourceSpec[Text], meaning: TextMeaning, sample: Sample[Text], faults: tuple[Fault, ...]
) -> Iterator[Condition]:
    """Yields the condition of the newest text, stale or not; of an unknown one, that of the last known."""
    text = sample.value.text if sample.value else None
    beginning = f"{spec.name}.value."
    if text is None:
        for fault in faults:
            if fault.seen_severity and fault.condition.fault_id.startswith(beginning):
                yield fault.condition
    elif severity := meaning.severity(text):
        yield Condition(
            # Texts that are not listed share an id, so that their number is bounded.
            f"{beginning}{_slug(text) if meaning.is_listed(text) else _OTHER}",
            severity,
            spec.display_name,
            f"{spec.display_name}: {text or 'an empty text'}",
            meaning.remedy or f"Check {spec.display_name} on the robot; its configuration has the levels",
        )


def worst_severity(conditions: Iterator[Condition]) -> Severity | None:
    """Returns the most severe one of the conditions' severities; None if there are none."""
    return max((each.severity for each in conditions), key=lambda severity: severity.rank, default=None)


def _slug(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")[:_LONGEST_SLUG] or "unnamed"
