"""Faults as the window lists them: what is wrong, then what to do."""

from dataclasses import dataclass

from console.client.results import Fault, FaultSeverity
from console.monitor.state import MonitorState
from console.tone import Tone
from console.words import age

_TONES = {
    FaultSeverity.ERROR: Tone.BAD,
    FaultSeverity.WARNING: Tone.WARNING,
    FaultSeverity.INFO: Tone.QUIET,
    FaultSeverity.UNKNOWN: Tone.WARNING,
}


@dataclass(frozen=True, slots=True)
class FaultLine:
    """One fault.

    Args:
        mark: its severity, or "over".
        tone: how much it wants to be noticed.
        message: what is wrong, with the component that has it.
        remedy: what to do; empty when it is over.
        since: how long it has been there, or over.
    """

    mark: str
    tone: Tone
    message: str
    remedy: str
    since: str


def fault_lines(state: MonitorState, now_s: float) -> list[FaultLine]:
    """The worst first, then those that are over; empty when nothing is wrong or nothing is known."""
    if state.snapshot is None:
        return []
    silent_ms = state.silent_ms(now_s)
    return [_line(fault, silent_ms) for fault in state.snapshot.status.faults]


def _line(fault: Fault, silent_ms: int) -> FaultLine:
    message = f"{fault.component}: {fault.message}" if fault.component else fault.message
    if fault.active:
        since = f"for {age(fault.age_ms + silent_ms)}"
        return FaultLine(fault.severity.value, _TONES[fault.severity], message, fault.remedy, since)
    over = "" if fault.cleared_age_ms is None else f"{age(fault.cleared_age_ms + silent_ms)} ago"
    return FaultLine("over", Tone.QUIET, message, "", over)
