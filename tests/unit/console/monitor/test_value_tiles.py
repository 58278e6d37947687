"""Tiles over the picture: which ones, in which order, and how a value looks by its level and its age."""

from collections.abc import Callable
from typing import TypeVar

from console.monitor.link import Link, LinkState
from console.monitor.monitor_state import MonitorState
from console.monitor.value_tiles import MOST_TILES, TileItem, fitting, tile_items
from console.presentation.severity_style import SeverityStyle
from gateway.config import generic_sources
from omniseer.gateway.v1 import overlay_pb2, value_pb2
from tests.support.snapshots import NOW_S, heard, snapshot

Value = TypeVar("Value", value_pb2.NumberStatus, value_pb2.TextStatus)
WARNING, ERROR = value_pb2.NUMBER_LEVEL_WARNING_HIGH, value_pb2.NUMBER_LEVEL_ERROR_HIGH


def changed(value: Value, changes: dict[str, object]) -> Value:
    """Sets fields, to their defaults as well, which a merge would leave out."""
    for name, each in changes.items():
        setattr(value, name, each)
    return value


def number(made: overlay_pb2.OverlaySnapshot, label: str = "motor", **changes: object) -> None:
    """Adds a good, fresh number and its source."""
    each = value_pb2.NumberStatus(
        label=label,
        title=label,
        available=True,
        age_ms=40,
        value=61.25,
        unit="°C",
        decimals=1,
        level=value_pb2.NUMBER_LEVEL_GOOD,
        tile=True,
    )
    made.status.numbers.append(changed(each, changes))
    made.status.sources.add(name=f"number.{label}")


def text(made: overlay_pb2.OverlaySnapshot, label: str = "gripper", **changes: object) -> None:
    """Adds a good, fresh text and its source."""
    each = value_pb2.TextStatus(
        label=label,
        title=label,
        available=True,
        text="open",
        level=value_pb2.TEXT_LEVEL_GOOD,
        tile=True,
    )
    made.status.texts.append(changed(each, changes))
    made.status.sources.add(name=f"text.{label}")


def robot(change: Callable[[overlay_pb2.OverlaySnapshot], object]) -> MonitorState:
    return heard(snapshot(change))


def only(change: Callable[[overlay_pb2.OverlaySnapshot], object], now_s: float = NOW_S) -> TileItem:
    (item,) = tile_items(robot(change), now_s)
    return item


def test_a_good_value_is_quiet_and_written_as_in_the_status() -> None:
    assert only(number) == TileItem("Motor", "61.2 °C")
    assert only(text) == TileItem("Gripper", "open")


def test_a_level_has_its_word_and_colour() -> None:
    hot = only(lambda made: number(made, level=ERROR))
    assert (hot.mark, hot.style, hot.dim) == ("TOO HIGH", SeverityStyle.BAD, False)
    slipping = only(lambda made: text(made, level=value_pb2.TEXT_LEVEL_WARNING))
    assert (slipping.mark, slipping.style, slipping.dim) == ("WARNING", SeverityStyle.WARNING, False)
    assert slipping.spoken == "Gripper: open, WARNING"


def test_a_value_that_is_too_old_is_dim_and_has_its_age() -> None:
    old = only(lambda made: number(made, stale=True, age_ms=7000, level=ERROR))
    assert (old.value, old.mark, old.age, old.dim) == ("61.2 °C", "STALE", "7.0 s", True)
    assert old.style is SeverityStyle.WARNING
    assert old.spoken == "Motor: 61.2 °C, STALE, 7.0 s"


def test_a_latched_value_that_still_holds_has_no_age() -> None:
    assert only(lambda made: text(made, age_ms=3_600_000)) == TileItem("Gripper", "open")


def test_a_value_that_never_came_is_no_data() -> None:
    missing = only(lambda made: made.status.numbers.add(label="motor", title="Motor", tile=True))
    assert missing == TileItem("Motor", "-", "no data", SeverityStyle.QUIET, dim=True)


def test_a_message_without_the_number_is_a_warning() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        number(made, level=value_pb2.NUMBER_LEVEL_UNSPECIFIED)
        made.status.numbers[0].ClearField("value")

    unknown = only(change)
    assert (unknown.value, unknown.mark, unknown.style) == ("-", "UNKNOWN", SeverityStyle.WARNING)


def test_nothing_is_fresh_while_the_robot_is_silent() -> None:
    silent = only(number, NOW_S + 60)
    assert (silent.mark, silent.age, silent.dim) == ("STALE", "1 min 00 s", True)
    cut = heard(snapshot(number))
    cut = MonitorState(Link(state=LinkState.LOST, since_s=NOW_S), cut.snapshot, NOW_S)
    (item,) = tile_items(cut, NOW_S)
    assert (item.mark, item.dim) == ("STALE", True)


def test_only_values_that_ask_for_it_are_tiles() -> None:
    assert tile_items(robot(lambda made: number(made, tile=False)), NOW_S) == ()
    assert tile_items(MonitorState(Link(state=LinkState.CONNECTING, since_s=0)), NOW_S) == ()


def test_numbers_and_texts_stand_in_the_order_of_the_configuration() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        text(made, "arm")
        number(made, "b")
        text(made, "lift")
        number(made, "a")
        # Of a gateway that does not list its sources.
        made.status.numbers.add(label="last", title="last", tile=True)

    found = [item.title for item in tile_items(robot(change), NOW_S)]
    assert found == ["Arm", "B", "Lift", "A", "Last"]


def test_of_more_than_six_the_first_ones_are_shown() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        for place in range(8):
            number(made, f"n{place}", level=ERROR if place == 7 else WARNING)

    assert [item.title for item in tile_items(robot(change), NOW_S)] == [f"N{place}" for place in range(6)]
    assert generic_sources.MOST_TILES == MOST_TILES == 6


def test_where_few_fit_the_worst_ones_are_shown_in_their_order() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        number(made, "a")
        number(made, "b", level=WARNING)
        number(made, "c")
        number(made, "d", level=ERROR)
        number(made, "e", level=WARNING)

    items = tile_items(robot(change), NOW_S)

    def shown(room: int) -> str:
        return "".join(item.title for item in fitting(items, room))

    assert [shown(room) for room in (9, 5, 4, 3, 2, 1, 0, -1)] == [
        "ABCDE", "ABCDE", "ABDE", "BDE", "BD", "D", "", "",
    ]  # fmt: skip


def test_what_was_bad_goes_before_what_is_merely_old() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        number(made, "a")
        number(made, "b", level=ERROR)

    items = tile_items(robot(change), NOW_S + 60)
    assert [item.title for item in fitting(items, 1)] == ["B"]
