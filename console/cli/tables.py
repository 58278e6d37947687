"""Rows and overlays as calm tables: no boxes, colour only where something wants to be noticed."""

from collections.abc import Iterable
from typing import Final

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from console.cli.rows import Row, status_rows
from console.client.results import Detections, Freshness, OverlaySnapshot, SystemStatus
from console.tone import Tone
from console.words import age

STYLES: Final = {Tone.GOOD: "green", Tone.QUIET: "dim", Tone.WARNING: "bold yellow", Tone.BAD: "bold red"}


def status_view(status: SystemStatus, target: str) -> RenderableType:
    """The whole status."""
    return Group(headline(status, target), Text(), rows_table(status_rows(status)))


def headline(status: SystemStatus, target: str) -> Text:
    """Who is speaking."""
    name = status.gateway_name or "robot"
    return Text.assemble((name, "bold"), (f"  {target}, gateway {status.gateway_version or '?'}", "dim"))


def rows_table(rows: Iterable[Row]) -> Table:
    """One line per row; long texts wrap inside their column."""
    table = Table.grid(padding=(0, 2))
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    table.add_column(justify="right", no_wrap=True, style="dim")
    for row in rows:
        body = "dim" if row.tone is Tone.WARNING and row.mark == "STALE" else ""
        table.add_row(row.label, Text(row.mark, style=STYLES[row.tone]), Text(row.text, style=body), row.age)
    return table


def overlay_view(snapshot: OverlaySnapshot, target: str) -> RenderableType:
    """Detections and events under one line of health."""
    parts: list[RenderableType] = [
        headline(snapshot.status, target),
        Text(),
        rows_table([_detections_row(snapshot.detections)]),
    ]
    if snapshot.detections.items:
        parts += [Text(), _detections_table(snapshot.detections)]
    if snapshot.events:
        parts += [Text(), _events_table(snapshot)]
    return Group(*parts)


def _detections_row(detections: Detections) -> Row:
    match detections.freshness:
        case Freshness.MISSING:
            return Row("detections", "no data", Tone.QUIET, "")
        case Freshness.STALE:
            mark, tone = "STALE", Tone.WARNING
        case Freshness.FRESH:
            mark, tone = "fresh", Tone.GOOD
    listed = len(detections.items)
    capped = f", the first {listed} of them below" if listed < (detections.count or 0) else ""
    image = f"{detections.source_width_px}x{detections.source_height_px}"
    text = f"{detections.count} in a picture of {image} pixels{capped}"
    return Row("detections", mark, tone, text, age(detections.age_ms))


def _detections_table(detections: Detections) -> Table:
    table = Table.grid(padding=(0, 2))
    for _ in range(2):
        table.add_column(no_wrap=True)
    for _ in range(3):
        table.add_column(justify="right", no_wrap=True)
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
    table = Table.grid(padding=(0, 2))
    for _ in range(2):
        table.add_column(justify="right", no_wrap=True, style="dim")
    table.add_column(overflow="fold")
    for event in snapshot.events:
        table.add_row(f"#{event.sequence}", f"{age(event.age_ms)} ago", Text(event.message))
    return table
