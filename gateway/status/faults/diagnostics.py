"""Faults that the robot's components report about themselves (REP-107)."""

import re
from collections.abc import Iterator
from typing import Final

from gateway.status.fault import Condition, Severity
from gateway.status.freshness import Sample
from gateway.status.values import DiagnosticItem, DiagnosticLevel, Diagnostics

_SEVERITIES: Final = {DiagnosticLevel.ERROR: Severity.ERROR, DiagnosticLevel.STALE: Severity.WARNING}
"""The levels that are faults."""
_MAX_ID_LENGTH: Final = 64
_MAX_TEXT_LENGTH: Final = 200


def diagnostics_faults(diagnostics: Sample[Diagnostics]) -> Iterator[Condition]:
    """Yields one condition per component; the most severe one where two components share an id.

    A component that stops reporting keeps its last state: silence is no sign of recovery.
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
    component = _one_line(item.component) or "a component without a name"
    no_text = "has stopped reporting" if item.level is DiagnosticLevel.STALE else "reports an error"
    return Condition(
        f"diagnostics.{_slug(item.component)}",
        severity,
        component,
        f"{component}: {_one_line(item.message) or no_text}",
        "Check the log of that component on the robot",
    )


def _slug(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:_MAX_ID_LENGTH] or "unnamed"


def _one_line(text: str) -> str:
    """Returns printable text. Slashes join the names of ROS nodes, which operators don't need."""
    printable = "".join(letter if letter.isprintable() and letter != "/" else " " for letter in text)
    return " ".join(printable.split())[:_MAX_TEXT_LENGTH]
