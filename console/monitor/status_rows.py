"""Rows of the side panel: the robot's faults, and its status by component."""

from dataclasses import dataclass

from console.client.results import Fault
from console.monitor.monitor_state import MonitorState
from console.presentation.formatting import age
from console.presentation.severity_style import FAULT_STYLES, SeverityStyle
from console.presentation.status_table import Density, Row, View, table_rows


@dataclass(frozen=True, slots=True)
class FaultLine:
    """One fault.

    Args:
        mark: its severity, or "cleared".
        style: colour and shape of the line.
        message: the fault, after the name of its component.
        remedy: what to do; empty once it is cleared.
        since: how long it has been active, or cleared.
    """

    mark: str
    style: SeverityStyle
    message: str
    remedy: str
    since: str


def fault_lines(state: MonitorState, now_s: float) -> list[FaultLine]:
    """Returns the active faults, the worst first, then the cleared ones; empty before the first snapshot."""
    if state.snapshot is None:
        return []
    snapshot_age_ms = state.snapshot_age_ms(now_s)
    return [_line(fault, snapshot_age_ms) for fault in state.snapshot.status.faults]


def component_rows(state: MonitorState, now_s: float) -> list[Row]:
    """Returns the compact table of the status; empty before the first snapshot."""
    if state.snapshot is None:
        return []
    snapshot, age_ms = state.snapshot, state.snapshot_age_ms(now_s)
    outdated = state.outdated(now_s)
    return table_rows(View(snapshot.status, Density.COMPACT, snapshot.detections, age_ms, outdated))


def _line(fault: Fault, snapshot_age_ms: int) -> FaultLine:
    message = f"{fault.component}: {fault.message}" if fault.component else fault.message
    if fault.active:
        since = f"for {age(fault.age_ms + snapshot_age_ms)}"
        return FaultLine(fault.severity.value, FAULT_STYLES[fault.severity], message, fault.remedy, since)
    since = "" if fault.cleared_age_ms is None else f"{age(fault.cleared_age_ms + snapshot_age_ms)} ago"
    return FaultLine("cleared", SeverityStyle.QUIET, message, "", since)
