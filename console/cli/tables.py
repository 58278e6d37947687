"""Statuses and overlays as terminal tables: no boxes, and colour only for what needs attention."""

from collections.abc import Iterable
from typing import Final

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from console.client.results import Detections, OverlaySnapshot, SystemStatus
from console.presentation.formatting import age
from console.presentation.severity_style import SeverityStyle
from console.presentation.status_row import Row, View
from console.presentation.status_table import table_rows

STYLES: Final = {
    SeverityStyle.GOOD: "green",
    SeverityStyle.QUIET: "dim",
    SeverityStyle.WARNING: "bold yellow",
    SeverityStyle.BAD: "bold red",
}


def status_view(status: SystemStatus, target: str) -> RenderableType:
    """Returns the whole status under a headline."""
    return Group(headline(status, target), Text(), rows_table(table_rows(View(status))))


def headline(status: SystemStatus, target: str) -> Text:
    """Returns the robot's name, address and gateway version."""
    name = status.gateway_name or "robot"
    return Text.assemble((name, "bold"), (f"  {target}, gateway {status.gateway_version or '?'}", "dim"))


def rows_table(rows: Iterable[Row]) -> Table:
    """Returns one line per row; long texts wrap inside their column."""
    table = grid("nowrap", "nowrap", "fold", "right")
    for row in rows:
        body = "dim" if row.style is SeverityStyle.WARNING and row.mark == "STALE" else ""
        text = Text(row.text, style=body)
        mark = Text(row.mark, style=STYLES[row.style])
        # A label may be the robot's own words: as plain text they can't be taken for markup.
        table.add_row(Text(row.label), mark, text, Text(row.age, style="dim"))
    return table


def grid(*columns: str) -> Table:
    """Returns an empty table without lines.

    Args:
        columns: One each: "nowrap" stays on one line, "right" too and is aligned right, "fold" wraps.
    """
    table = Table.grid(padding=(0, 2))
    for column in columns:
        table.add_column(
            no_wrap=column != "fold", overflow="fold", justify="right" if column == "right" else "left"
        )
    return table


def overlay_view(snapshot: OverlaySnapshot, target: str) -> RenderableType:
    """Returns detections and events under a headline."""
    parts: list[RenderableType] = [
        headline(snapshot.status, target),
        Text(),
        rows_table([_detections_row(snapshot)]),
    ]
    if snapshot.detections.items:
        parts += [Text(), _detections_table(snapshot.detections)]
    if snapshot.events:
        parts += [Text(), _events_table(snapshot)]
    return Group(*parts)


def _detections_row(snapshot: OverlaySnapshot) -> Row:
    detections = snapshot.detections
    listed = len(detections.items)
    capped = f", the first {listed} of them below" if listed < (detections.count or 0) else ""
    size = f"{detections.source_width_px}x{detections.source_height_px}"
    text = f"{detections.count} in a frame of {size} pixels{capped}"
    return View(snapshot.status).measured("detections", detections, text)


def _detections_table(detections: Detections) -> Table:
    table = grid("nowrap", "nowrap", "right", "right", "right")
    table.add_row("class", "track", "score", "centre (px)", "size (px)", style="dim")
    for item in detections.items:
        table.add_row(
            Text(item.class_name or f"class {item.class_id}"),
            Text(item.track_id or "-"),
            f"{item.score:.2f}",
            f"{item.center_x_px:.0f}, {item.center_y_px:.0f}",
            f"{item.width_px:.0f} x {item.height_px:.0f}",
        )
    return table


def _events_table(snapshot: OverlaySnapshot) -> Table:
    table = grid("right", "right", "fold")
    for event in snapshot.events:
        when = Text(f"{age(event.age_ms)} ago", style="dim")
        table.add_row(Text(f"#{event.sequence}", style="dim"), when, Text(event.message))
    return table
