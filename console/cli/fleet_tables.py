"""The fleet, its events and its recordings as terminal tables."""

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from console.cli.tables import STYLES, grid
from console.cli.tables import rows_table as detail_table
from console.client.results import FaultSeverity
from console.fleet.columns import Cell, columns_for, shortened, summary_line
from console.fleet.details import detail_rows
from console.fleet.model import summary
from console.fleet.values import (
    CommandAnswer,
    CommandOutcome,
    DropReason,
    EventsDropped,
    FleetItem,
    FleetRow,
    ReceiptCheck,
    RobotEvent,
    StoredRecording,
    Unreadable,
)
from console.presentation.formatting import age, plural, size, wall_clock, without_component
from console.presentation.severity_style import FAULT_STYLES, SeverityStyle

_LONGEST_MESSAGE = 500
_DROP_REASONS = {
    DropReason.OUTBOX_FULL: "the robot's outbox was full",
    DropReason.NO_LONGER_KEPT: "the robot's gateway no longer kept them",
    DropReason.DISK: "the robot could not write them to its disk",
    DropReason.OUTBOX_LOST: "the robot's outbox was damaged or deleted",
    DropReason.UNKNOWN: "for a reason that this robotctl does not know",
}
_RECEIPT_STYLES = {
    ReceiptCheck.VALID: SeverityStyle.GOOD,
    ReceiptCheck.MISSING: SeverityStyle.WARNING,
    ReceiptCheck.UNKNOWN_KEY: SeverityStyle.BAD,
    ReceiptCheck.INVALID: SeverityStyle.BAD,
}
OUTCOME_STYLES = {
    CommandOutcome.DONE: SeverityStyle.GOOD,
    CommandOutcome.REFUSED: SeverityStyle.WARNING,
    CommandOutcome.EXPIRED: SeverityStyle.WARNING,
    CommandOutcome.FAILED: SeverityStyle.BAD,
    CommandOutcome.UNKNOWN: SeverityStyle.WARNING,
}


def rows_table(rows: tuple[FleetRow, ...], width: int) -> Table:
    """Returns one line per robot, with the columns for a terminal of so many characters."""
    columns = columns_for(width)
    table = Table.grid(padding=(0, 2))
    for column in columns:
        table.add_column(
            no_wrap=True,
            overflow="ellipsis",
            justify="right" if column.right else "left",
            max_width=column.width,
        )
    table.add_row(*(column.title for column in columns), style="dim")
    for row in rows:
        table.add_row(*(_text(column.cell(row)) for column in columns))
    return table


def fleet_view(rows: tuple[FleetRow, ...], width: int) -> RenderableType:
    """Returns the whole fleet above its summary."""
    line = Text(summary_line(summary(rows)), style="dim")
    return (
        Group(rows_table(rows, width), Text(), line)
        if rows
        else Text("No robot is enrolled yet.", style="dim")
    )


def robot_view(row: FleetRow) -> RenderableType:
    """Returns one robot whole, under its name."""
    seen = "" if row.last_seen_ms is None else f"  seen {age(row.last_seen_ms)} ago"
    head = Text.assemble((shortened(row.robot), "bold"), (seen, "dim"))
    return Group(head, Text(), detail_table(detail_rows(row)))


def item_line(item: FleetItem) -> Text:
    """Returns an event, a gap or what is unreadable on one line."""
    match item:
        case RobotEvent(event=event):
            loud = event.severity in (FaultSeverity.WARNING, FaultSeverity.ERROR)
            style = STYLES[FAULT_STYLES[event.severity]] if loud else ""
            return Text("  ").join(
                (
                    Text(f"{wall_clock(event.wall_clock_unix_ms):24}", style="dim"),
                    Text(f"{shortened(item.robot):12}", style="bold"),
                    Text(f"{event.severity.value:7}", style=style),
                    Text(f"{shortened(event.component):10}"),
                    Text(shortened(without_component(event.component, event.message), _LONGEST_MESSAGE)),
                )
            )
        case EventsDropped():
            return Text(f"--- {shortened(item.robot)}: {_missing(item)}", style="bold yellow")
        case Unreadable():
            return Text(f"--- {shortened(item.robot)}: unreadable: {item.problem}", style="bold red")


def recordings_table(items: list[StoredRecording | Unreadable]) -> Table:
    """Returns one line per recording."""
    table = grid("nowrap", "nowrap", "nowrap", "right", "right", "nowrap", "fold")
    table.add_row("robot", "id", "began", "size", "files", "receipt", "label", style="dim")
    for item in items:
        if isinstance(item, Unreadable):
            problem = Text(f"unreadable: {item.problem}", style=STYLES[SeverityStyle.BAD])
            table.add_row(Text(shortened(item.robot)), *(Text("-"),) * 5, problem)
            continue
        recording = item.recording
        table.add_row(
            Text(shortened(item.robot), style="bold"),
            Text(shortened(recording.id)),
            Text(wall_clock(recording.started_unix_ms)),
            size(recording.size),
            str(recording.file_count),
            Text(item.receipt.value, style=STYLES[_RECEIPT_STYLES[item.receipt]]),
            Text(shortened(recording.label or recording.preset)),
        )
    return table


def answer_line(answer: CommandAnswer) -> Text:
    """Returns what became of a command."""
    recording = f" ({answer.recording_id})" if answer.recording_id else ""
    return Text.assemble(
        (answer.outcome.value.upper(), STYLES[OUTCOME_STYLES[answer.outcome]]),
        f"  {shortened(answer.robot)}: {shortened(answer.message, _LONGEST_MESSAGE)}{shortened(recording)}",
    )


def _missing(item: EventsDropped) -> str:
    worst = (
        ""
        if item.worst_severity is FaultSeverity.UNKNOWN
        else f", the worst of severity {item.worst_severity.value}"
    )
    earlier = "; of an earlier run, too, an unknown number" if item.earlier_run_incomplete else ""
    return f"{plural(item.count, 'event')} missing{worst}: {_DROP_REASONS[item.reason]}{earlier}"


def _text(cell: Cell) -> Text:
    return Text(cell.text, style=STYLES[cell.style] if cell.style else "")
