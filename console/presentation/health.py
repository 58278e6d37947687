"""A robot's health for people: its text, and a style that denies none of the faults that the text counts."""

from collections.abc import Iterable
from typing import Final

from console.client.results import Fault, FaultSeverity, HealthState, SystemStatus
from console.presentation.formatting import joined, plural
from console.presentation.severity_style import HEALTH_STYLES, SeverityStyle

_COUNTED: Final = (FaultSeverity.ERROR, FaultSeverity.WARNING)


def health_counts(faults: Iterable[Fault]) -> str:
    """Returns how many errors and warnings are active, "1 error, 2 warnings"; empty without any."""
    severities = active_severities(faults)
    return joined(
        *(plural(number, severity.value) for severity in _COUNTED if (number := severities.count(severity)))
    )


def health_summary(status: SystemStatus) -> str:
    """Returns the reason of the health, and how many errors and warnings are active."""
    counts = health_counts(status.faults)
    return status.health.summary + (f" ({counts})" if counts else "")


def health_style(state: HealthState, severities: Iterable[FaultSeverity]) -> SeverityStyle:
    """Returns the style of the health, a warning while an error or a warning is active.

    The health may ignore a fault (`faults.ignored_by_health`); "OK" in green beside "1 error" would deny it.
    It is a warning for an error, too: a robot that may ignore it is no worse than a degraded one.

    Args:
        state: what the robot says.
        severities: of its active faults.
    """
    counted = any(severity in _COUNTED for severity in severities)
    return SeverityStyle.WARNING if counted else HEALTH_STYLES[state]


def active_severities(faults: Iterable[Fault]) -> list[FaultSeverity]:
    """Returns the severities of the faults that are active."""
    return [fault.severity for fault in faults if fault.active]
