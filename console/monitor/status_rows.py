"""Rows of the side panel: the robot's faults, and its status by component."""

from console.client.results import Fault
from console.monitor.monitor_state import MonitorState
from console.presentation.formatting import age
from console.presentation.severity_style import FAULT_STYLES, SeverityStyle
from console.presentation.status_table import Row, View, table_rows


def fault_rows(state: MonitorState, now_s: float) -> list[Row]:
    """Returns the active faults, the worst first, then the cleared ones; empty before the first snapshot."""
    if state.snapshot is None:
        return []
    snapshot_age_ms = state.snapshot_age_ms(now_s)
    return [_fault_row(fault, snapshot_age_ms) for fault in state.snapshot.status.faults]


def component_rows(state: MonitorState, now_s: float) -> list[Row]:
    """Returns the compact table of the status; empty before the first snapshot."""
    if state.snapshot is None:
        return []
    view = View(
        state.snapshot.status,
        compact=True,
        detections=state.snapshot.detections,
        silent_ms=state.snapshot_age_ms(now_s),
        outdated=state.outdated(now_s),
    )
    return table_rows(view)


def _fault_row(fault: Fault, snapshot_age_ms: int) -> Row:
    # Of a diagnostic component the message begins with its name.
    named = not fault.component or fault.message.startswith(f"{fault.component}:")
    text = fault.message if named else f"{fault.component}: {fault.message}"
    if fault.active:
        since = f"for {age(fault.age_ms + snapshot_age_ms)}"
        return Row("", fault.severity.value, FAULT_STYLES[fault.severity], text, since, fault.remedy)
    since = "" if fault.cleared_age_ms is None else f"{age(fault.cleared_age_ms + snapshot_age_ms)} ago"
    return Row("", "cleared", SeverityStyle.QUIET, text, since)
