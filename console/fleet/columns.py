"""The columns of the fleet's table, in the order of an operator's interest. Pure text with styles."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

from console.client.results import FaultSeverity, Freshness, RecordingCopyState, Sample
from console.fleet.model import FleetSummary, worst_fault
from console.fleet.values import FleetRow, RobotState
from console.presentation.formatting import UNKNOWN, age, joined, plural, quantity, size
from console.presentation.measured_text import number_text
from console.presentation.severity_style import FAULT_STYLES, HEALTH_STYLES, SeverityStyle
from console.presentation.value_style import (
    BATTERY_FAULTS,
    CHARGE_PERCENT,
    DISK_FAULTS,
    DISK_PERCENT,
    Judgement,
    no_better,
    of_number,
    of_text,
)
from fleet.standing import Standing

STANDING_STYLES: Final[Mapping[Standing, SeverityStyle]] = {
    Standing.UP: SeverityStyle.GOOD,
    Standing.NO_GATEWAY: SeverityStyle.BAD,
    Standing.AWAY: SeverityStyle.WARNING,
    Standing.NEVER_SEEN: SeverityStyle.QUIET,
    Standing.REVOKED: SeverityStyle.QUIET,
    Standing.NOT_ENROLLED: SeverityStyle.WARNING,
    Standing.UNREADABLE: SeverityStyle.BAD,
}
LONGEST_TEXT: Final = 60
"""Characters of a robot's own words in a cell: one robot must not push the others off the screen."""
_PERCENT: Final = 100


@dataclass(frozen=True, slots=True)
class Cell:
    """A text and its style; None is the terminal's own."""

    text: str
    style: SeverityStyle | None = None


@dataclass(frozen=True, slots=True)
class Column:
    """One column.

    Args:
        title: Its heading.
        width: Characters that it takes at the most.
        cell: Its cell of a row.
        right: Whether it is aligned right, as numbers are.
        rank: 0 is shown at any width; of the others a narrow terminal leaves out the highest first.
        grows: Whether it gets what a terminal has beyond the columns that it shows, up to `LONGEST_TEXT`.
    """

    title: str
    width: int
    cell: Callable[[FleetRow], Cell]
    right: bool = False
    rank: int = 0
    grows: bool = False


def shortened(text: str, longest: int = LONGEST_TEXT) -> str:
    """Returns a text of at most so many characters, with an ellipsis where something is missing."""
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


def columns_for(width: int) -> tuple[Column, ...]:
    """Returns the columns for a terminal of so many characters: all, or those that matter most."""
    for rank in sorted({column.rank for column in COLUMNS}, reverse=True):
        shown = tuple(column for column in COLUMNS if column.rank <= rank)
        left = width - sum(column.width + _GAP for column in shown)
        if not rank or left >= 0:
            break
    return tuple(_grown(column, max(left, 0)) for column in shown)


def _grown(column: Column, left: int) -> Column:
    return replace(column, width=min(column.width + left, LONGEST_TEXT)) if column.grows else column


def summary_line(found: FleetSummary) -> str:
    """Returns the fleet on one line."""
    return joined(
        f"{found.up} of {plural(found.robots, 'robot')} up",
        f"{found.silent} silent" if found.silent else "",
        f"{found.with_errors} with errors" if found.with_errors else "",
        f"{found.with_warnings} with warnings" if found.with_warnings else "",
        plural(found.uploads, "upload") if found.uploads else "",
        f"{plural(found.outbox_events, 'event')} waiting" if found.outbox_events else "",
        f"{plural(found.events_dropped, 'event')} dropped" if found.events_dropped else "",
    )


def _standing(row: FleetRow) -> Cell:
    return Cell(row.standing.value.upper(), STANDING_STYLES[row.standing])


def _health(row: FleetRow) -> Cell:
    if row.problem:
        return Cell(row.problem, SeverityStyle.BAD)
    state = row.state
    if state is None:
        return Cell(UNKNOWN, SeverityStyle.QUIET)
    worst = worst_fault(state)
    if worst is None:
        return Cell(
            shortened(state.summary or state.health.value), _last_known(row, HEALTH_STYLES[state.health])
        )
    others = f" (+{state.fault_count - 1})" if state.fault_count > 1 else ""
    word = "" if worst.severity is FaultSeverity.UNKNOWN else f"{worst.severity.value}: "
    text = shortened(f"{word}{worst.message or worst.fault_id}", LONGEST_TEXT - len(others))
    return Cell(f"{text}{others}", _last_known(row, FAULT_STYLES[worst.severity]))


def battery_cell(state: RobotState) -> Cell:
    """Returns the state of charge, with a plus while it is being charged."""
    found = _no_better(CHARGE_PERCENT.judge(state.battery_percent), state, BATTERY_FAULTS)
    charging = " +" if state.charging else ""
    return _judged(found, f"{quantity(state.battery_percent, '%', 0)}{charging}")


def disk_cell(state: RobotState) -> Cell:
    """Returns the used part of the disk."""
    found = _no_better(DISK_PERCENT.judge(state.disk_used_percent), state, DISK_FAULTS)
    return _judged(found, quantity(state.disk_used_percent, "%", 0))


def _uploads(state: RobotState) -> Cell:
    if not state.uploads:
        return Cell(str(state.upload_count or UNKNOWN), SeverityStyle.QUIET)
    first = state.uploads[0]
    done = f" {min(first.copy.bytes_done, first.size) * _PERCENT // first.size} %" if first.size else ""
    rate = f" {size(first.bytes_per_s)}/s" if first.bytes_per_s else ""
    more = f" (+{state.upload_count - 1})" if state.upload_count > 1 else ""
    stuck = first.copy.state in (RecordingCopyState.FAILED, RecordingCopyState.PAUSED)
    return Cell(
        f"{first.copy.state.value}{done}{rate}{more}", SeverityStyle.WARNING if stuck else SeverityStyle.GOOD
    )


def _outbox(state: RobotState) -> Cell:
    dropped = f", {state.events_dropped} dropped" if state.events_dropped else ""
    style = SeverityStyle.WARNING if dropped else SeverityStyle.QUIET
    return Cell(f"{state.outbox_events or UNKNOWN}{dropped}", style)


def _values(state: RobotState) -> Cell:
    """The values that the robot's configuration names, the worst first: a cell has room for a few."""
    texts = [*_numbers(state), *_texts(state)]
    if not texts:
        return Cell(UNKNOWN, SeverityStyle.QUIET)
    texts.sort(key=lambda one: _ORDER.index(one[1]), reverse=True)
    more = f" (+{state.values_left_out})" if state.values_left_out else ""
    shown = shortened(joined(*(text for text, _ in texts)), LONGEST_TEXT - len(more))
    worst = texts[0][1]
    return Cell(f"{shown}{more}", None if worst is SeverityStyle.GOOD else worst)


def _numbers(state: RobotState) -> Iterator[tuple[str, SeverityStyle]]:
    for each in state.numbers:
        yield _value(each, each.title or each.label, number_text(each), of_number(each))


def _texts(state: RobotState) -> Iterator[tuple[str, SeverityStyle]]:
    for each in state.texts:
        yield _value(each, each.title or each.label, each.text or UNKNOWN, of_text(each))


def _value(sample: Sample, title: str, text: str, found: Judgement) -> tuple[str, SeverityStyle]:
    match sample.freshness:
        case Freshness.MISSING:
            return f"{title} no data", SeverityStyle.QUIET
        case Freshness.STALE:
            return f"{title} {text} STALE", SeverityStyle.WARNING
        case Freshness.FRESH:
            return f"{title} {text} {found.word}".rstrip(), found.style


def _no_better(found: Judgement, state: RobotState, words: Mapping[str, str]) -> Judgement:
    return no_better(found, ((fault.fault_id, fault.severity) for fault in state.faults), words)


def _judged(found: Judgement, text: str) -> Cell:
    return Cell(joined(text, found.word), None if found.style is SeverityStyle.GOOD else found.style)


def _of_state(cell: Callable[[RobotState], Cell]) -> Callable[[FleetRow], Cell]:
    """Returns a cell of the robot's state, which is quiet where that is only the last known one."""

    def shown(row: FleetRow) -> Cell:
        if row.state is None:
            return Cell(UNKNOWN, SeverityStyle.QUIET)
        found = cell(row.state)
        return Cell(found.text, _last_known(row, found.style))

    return shown


def _last_known(row: FleetRow, style: SeverityStyle | None) -> SeverityStyle | None:
    return style if row.standing is Standing.UP else SeverityStyle.QUIET


_GAP: Final = 2
_ORDER: Final = (SeverityStyle.QUIET, SeverityStyle.GOOD, SeverityStyle.WARNING, SeverityStyle.BAD)
COLUMNS: Final = (
    Column("robot", 16, lambda row: Cell(shortened(row.robot))),
    Column("", 12, _standing),
    Column("since", 11, lambda row: Cell(age(row.since_ms)), right=True),
    Column("health", 20, _health, grows=True),
    Column("battery", 8, _of_state(battery_cell), right=True),
    Column("disk", 5, _of_state(disk_cell), right=True, rank=1),
    Column("mode", 10, _of_state(lambda it: Cell(shortened(it.mode, 20) or UNKNOWN)), rank=4),
    Column("values", 40, _of_state(_values), rank=5),
    Column("uploads", 20, _of_state(_uploads), rank=2),
    Column("outbox", 8, _of_state(_outbox), right=True, rank=3),
    Column("seen", 11, lambda row: Cell(age(row.last_seen_ms), SeverityStyle.QUIET), right=True),
)
