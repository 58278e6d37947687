"""Faults that the robot's components report of themselves."""

import re
from collections.abc import Iterator
from typing import Final

from gateway.status.faults.fault import Condition, Severity
from gateway.status.freshness import Sample
from gateway.status.values import DiagnosticItem, DiagnosticLevel, Diagnostics

_SEVERITIES: Final = {DiagnosticLevel.ERROR: Severity.ERROR, DiagnosticLevel.STALE: Severity.WARNING}
"""Levels that are faults."""
_LONGEST_ID: Final = 64
_LONGEST_TEXT: Final = 200


def diagnostics_faults(diagnostics: Sample[Diagnostics]) -> Iterator[Condition]:
    """One fault per component, the worst where two components have the same id.

    A component that stops reporting stays as it was: nobody has said that it is well again.
    """
    if diagnostics.value is None:
        return
    worst: dict[str, Condition] = {}
    for item in diagnostics.value.items:
        severity = _SEVERITIES.get(item.level)
        if severity is None:
            continue
        condition = _condition(item, severity)
        known = worst.get(condition.fault_id)
        if known is None or severity.rank > known.severity.rank:
            worst[condition.fault_id] = condition
    yield from worst.values()


def _condition(item: DiagnosticItem, severity: Severity) -> Condition:
    component = _words(item.component) or "a component without a name"
    said = _words(item.message)
    if item.level is DiagnosticLevel.STALE:
        said = said or "nothing is heard of it"
    return Condition(
        f"diagnostics.{_slug(item.component)}",
        severity,
        component,
        f"{component}: {said or 'reports an error'}",
        "Look at that component's log on the robot",
    )


def _slug(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:_LONGEST_ID] or "unnamed"


def _words(text: str) -> str:
    """One printable line. Slashes join the names of the robot's own programs: operators don't need them."""
    printable = "".join(letter if letter.isprintable() and letter != "/" else " " for letter in text)
    return " ".join(printable.split())[:_LONGEST_TEXT]
