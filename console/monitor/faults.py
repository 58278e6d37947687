"""Formats faults for the window: what is wrong, then the remedy."""

from dataclasses import dataclass

from console.client.results import Fault, FaultSeverity
from console.monitor.monitor_state import MonitorState
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
        mark: its severity, or "cleared".
        tone: colour and shape of the line.
        message: the fault, after the name of its component.
        remedy: what to do; empty once it is cleared.
        since: how long it has been active, or cleared.
    """

    mark: str
    tone: Tone
    message: str
    remedy: str
    since: str


def fault_lines(state: MonitorState, now_s: float) -> list[FaultLine]:
    """Returns the active faults, the worst first, then the cleared ones; empty before the first snapshot."""
    if state.snapshot is None:
        return []
    snapshot_age_ms = state.snapshot_age_ms(now_s)
    return [_line(fault, snapshot_age_ms) for fault in state.snapshot.status.faults]


def _line(fault: Fault, snapshot_age_ms: int) -> FaultLine:
    message = f"{fault.component}: {fault.message}" if fault.component else fault.message
    if fault.active:
        since = f"for {age(fault.age_ms + snapshot_age_ms)}"
        return FaultLine(fault.severity.value, _TONES[fault.severity], message, fault.remedy, since)
    since = "" if fault.cleared_age_ms is None else f"{age(fault.cleared_age_ms + snapshot_age_ms)} ago"
    return FaultLine("cleared", Tone.QUIET, message, "", since)
