"""Faults of the numbers that the configuration names: beyond a limit."""

from collections.abc import Iterator, Mapping
from typing import Final

from gateway.status.fault import Condition, Fault, Severity
from gateway.status.freshness import Sample
from gateway.status.meaning import NumberMeaning, Side, Violation
from gateway.status.sources import SourceSpec
from gateway.status.values import Number

_WORDS: Final[Mapping[tuple[Side, Severity], tuple[str, str]]] = {
    (Side.HIGH, Severity.ERROR): ("too high", "or more"),
    (Side.HIGH, Severity.WARNING): ("high", "or more"),
    (Side.LOW, Severity.WARNING): ("low", "or less"),
    (Side.LOW, Severity.ERROR): ("too low", "or less"),
}


def number_conditions(
    spec: SourceSpec[Number], meaning: NumberMeaning, sample: Sample[Number], faults: tuple[Fault, ...]
) -> Iterator[Condition]:
    """Yields the condition of the newest number, stale or not; an unknown one as the last known one."""
    found = violation_of(spec, meaning, sample, faults)
    if found is None:
        return
    word, beyond = _WORDS[found.side, found.severity]
    limit = f"{found.limit.raise_at:.10g} {meaning.unit}".strip()
    yield Condition(
        _fault_id(spec, found.side),
        found.severity,
        spec.display_name,
        f"{spec.display_name} is {word}: {limit} {beyond}",
        meaning.remedy or f"Check {spec.display_name} on the robot; its configuration has the limits",
    )


def violation_of(
    spec: SourceSpec[Number], meaning: NumberMeaning, sample: Sample[Number], faults: tuple[Fault, ...]
) -> Violation | None:
    """Returns which limit the newest value violates, with the hysteresis of the faults; None if none.

    A stale value is the last that is known: silence neither cures nor keeps a fault. An unknown one (NaN) is
    judged as the last known one was, which is not what its fault says while that is about to be cleared.
    """
    before = {
        side: fault.seen_severity
        for fault in faults
        for side in Side
        if fault.seen_severity and fault.condition.fault_id == _fault_id(spec, side)
    }
    value = sample.value.value if sample.value else None
    if value is not None:
        return meaning.violation(value, before)
    known = ((side, severity, meaning.limit(side, severity)) for side, severity in before.items())
    return next((Violation(side, severity, limit) for side, severity, limit in known if limit), None)


def _fault_id(spec: SourceSpec[Number], side: Side) -> str:
    return f"{spec.name}.{side.value}"
