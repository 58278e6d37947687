"""Tiles over the picture: the values that the robot's configuration wants there. Pure."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from console.client.results import Freshness, NumberValue, TextValue
from console.monitor.monitor_state import MonitorState
from console.presentation.formatting import UNKNOWN, joined
from console.presentation.severity_style import SeverityStyle
from console.presentation.status_row import Look, Row
from console.presentation.status_table import number_rows, text_rows
from console.presentation.value_style import NUMBER_LEVELS, TEXT_LEVELS

MOST_TILES: Final = 6
"""The gateway's check names the sources that ask for one beyond these."""
_RANKS: Final = {SeverityStyle.BAD: 2, SeverityStyle.WARNING: 1}


@dataclass(frozen=True, slots=True)
class TileItem:
    """One tile.

    Args:
        title: the value's name for people.
        value: with its unit, as the status has it.
        mark: what is remarkable: "TOO HIGH", "STALE", "no data"; empty for a good value.
        style: of the mark; a good value is quiet.
        age: of a value that is not fresh.
        dim: whether the value is not fresh: it says nothing of the present.
        rank: how bad it is, by its level and its age; more is worse.
    """

    title: str
    value: str
    mark: str = ""
    style: SeverityStyle = SeverityStyle.QUIET
    age: str = ""
    dim: bool = False
    rank: int = 0

    @property
    def spoken(self) -> str:
        """The whole tile in words."""
        return f"{self.title}: {joined(self.value, self.mark, self.age)}"


def tile_items(state: MonitorState, now_s: float) -> tuple[TileItem, ...]:
    """Returns the tiles in the order of the robot's configuration, the first `MOST_TILES` of them."""
    if state.snapshot is None:
        return ()
    status = state.snapshot.status
    look = Look(compact=True, silent_ms=state.snapshot_age_ms(now_s), outdated=state.outdated(now_s))
    # The status has numbers and texts apart; its sources stand as they are configured.
    places = {source.name: place for place, source in enumerate(status.sources)}
    found = [*_numbers(status.numbers, look), *_texts(status.texts, look)]
    found.sort(key=lambda one: places.get(one[0], len(places)))
    return tuple(item for _, item in found[:MOST_TILES])


def fitting(items: Sequence[TileItem], room: int) -> list[TileItem]:
    """Returns the tiles for which there is room, the worst and of equals the first ones, in their order."""
    worst = sorted(range(len(items)), key=lambda place: (-items[place].rank, place))[: max(0, room)]
    return [items[place] for place in sorted(worst)]


def _numbers(numbers: Iterable[NumberValue], look: Look) -> Iterator[tuple[str, TileItem]]:
    chosen = [each for each in numbers if each.tile]
    for each, row in zip(chosen, number_rows(chosen, look), strict=True):
        yield f"number.{each.label}", _item(each, row, look, NUMBER_LEVELS[each.level].style)


def _texts(texts: Iterable[TextValue], look: Look) -> Iterator[tuple[str, TileItem]]:
    chosen = [each for each in texts if each.tile]
    for each, row in zip(chosen, text_rows(chosen, look), strict=True):
        yield f"text.{each.label}", _item(each, row, look, TEXT_LEVELS[each.level].style)


def _item(value: NumberValue | TextValue, row: Row, look: Look, level: SeverityStyle) -> TileItem:
    fresh = value.freshness is Freshness.FRESH and not look.outdated
    good = row.style is SeverityStyle.GOOD
    return TileItem(
        row.label,
        row.text.replace("\u00a0", " ") or UNKNOWN,
        "" if good else row.mark,
        SeverityStyle.QUIET if good else row.style,
        "" if fresh else row.age,
        dim=not fresh,
        # What was bad when the robot fell silent stays so until it says otherwise.
        rank=max(_RANKS.get(style, 0) for style in (row.style, level)),
    )
