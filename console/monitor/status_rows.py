"""Rows of the side panel: the robot's faults, and its status by component."""

from dataclasses import dataclass
from typing import Final

from console.client.results import Fault
from console.monitor.alarm import Alarm, Occurrence, occurrence
from console.monitor.monitor_state import MonitorState
from console.presentation.formatting import age, with_component
from console.presentation.own_stream import OwnStream
from console.presentation.severity_style import FAULT_STYLES, SeverityStyle
from console.presentation.status_row import Row, View
from console.presentation.status_table import table_rows

_NO_FAULT: Final = Row("", "none", SeverityStyle.GOOD, "The robot reports no fault")
_WAS_NO_FAULT: Final = Row("", "none", SeverityStyle.QUIET, "The robot reported no fault")
_NO_STATUS: Final = Row("", "", SeverityStyle.QUIET, "No status received yet")


@dataclass(frozen=True, slots=True)
class FaultItem:
    """A fault in the list.

    Args:
        row: its texts.
        occurrence: what is acknowledged; None where the row is not a fault.
        pending: whether it waits for its acknowledgement.
    """

    row: Row
    occurrence: Occurrence | None = None
    pending: bool = False


def fault_items(state: MonitorState, alarm: Alarm, now_s: float) -> list[FaultItem]:
    """Returns the faults with their acknowledgement; a line that says so where there is none."""
    if state.snapshot is None:
        return [FaultItem(_NO_STATUS)]
    faults = state.snapshot.status.faults
    rows = fault_rows(state, now_s)
    items = [
        FaultItem(row, occurrence(fault), alarm.is_pending(occurrence(fault)))
        for row, fault in zip(rows, faults, strict=True)
    ]
    if any(fault.active for fault in faults):
        return items
    return [FaultItem(_WAS_NO_FAULT if state.outdated(now_s) else _NO_FAULT), *items]


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


def stream_rows(stream: OwnStream | None) -> list[Row]:
    """Returns the row of the stream as this computer receives it; none before it does."""
    if stream is None:
        return []
    mark, style = ("LATE", SeverityStyle.WARNING) if stream.is_fallback else ("direct", SeverityStyle.GOOD)
    return [Row("Stream here", mark, style, stream.text)]


def _fault_row(fault: Fault, snapshot_age_ms: int) -> Row:
    text = with_component(fault.component, fault.message)
    if fault.active:
        since = f"for {age(fault.age_ms + snapshot_age_ms)}"
        return Row("", fault.severity.value, FAULT_STYLES[fault.severity], text, since, fault.remedy)
    since = "" if fault.cleared_age_ms is None else f"{age(fault.cleared_age_ms + snapshot_age_ms)} ago"
    return Row("", "cleared", SeverityStyle.QUIET, text, since)
