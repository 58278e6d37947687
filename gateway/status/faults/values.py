"""Faults of the numbers and texts that the configuration names: a bad value, or messages without one."""

from collections.abc import Iterator
from typing import Any

from gateway.status.fault import Condition, Severity
from gateway.status.faults.numbers import number_conditions
from gateway.status.faults.texts import text_conditions
from gateway.status.meaning import NumberMeaning, TextMeaning
from gateway.status.snapshot import Snapshot
from gateway.status.source_view import SourceView
from gateway.status.values import Number, Text


def value_faults(snapshot: Snapshot) -> Iterator[Condition]:
    """Yields the present conditions. An unknown or stale value is judged as the last known one."""
    for source in snapshot.sources:
        spec, meaning = source.spec, source.spec.meaning
        match meaning:
            case NumberMeaning():
                yield from number_conditions(spec, meaning, snapshot[spec], snapshot.faults)
            case TextMeaning():
                yield from text_conditions(spec, meaning, snapshot[spec], snapshot.faults)
            case None:
                continue
        if source.freshness.fresh:
            yield from _no_value(source, snapshot[spec].value)


def _no_value(source: SourceView, value: Any) -> Iterator[Condition]:
    """Yields the condition of a fresh message without a value."""
    match value:
        case Number(value=None):
            what, cause = "a number", "it sends NaN, infinity, or a list too short"
        case Text(text=None):
            what, cause = "a text", "it sends a list too short"
        case _:
            return
    name = source.spec.display_name
    yield Condition(
        f"{source.spec.name}.no_value",
        Severity.ERROR if source.required else Severity.WARNING,
        name,
        f"{name} arrives without {what}: it is unknown, and can't be judged",
        f"Check its sensor and the program that publishes it: {cause}",
    )
