"""The table of sources is total: whatever it lists reaches every place where a source must be known."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.config import SourceSettings
from gateway.config.sources import KINDS
from gateway.ros.readers import reader_for, registry, types_of
from gateway.ros.readers.registry import reads
from gateway.rpc.calls.recipient import Recipient
from gateway.rpc.mapping.status import NOT_MAPPED, overlay_snapshot
from gateway.status.board import Board
from gateway.status.change import change_key
from gateway.status.meaning import ANY_NUMBER, ANY_TEXT
from gateway.status.snapshot import Snapshot, SourceRule
from gateway.status.source_view import SourceState
from gateway.status.sources import (
    DETECTIONS,
    DIAGNOSTICS,
    GENERIC_KINDS,
    MUX_INPUTS,
    PLATFORM_SOURCES,
    ROS_SOURCES,
    SOURCES,
    SourceSpec,
    number_source,
    text_source,
)
from gateway.status.values import Received
from tests.support.filled_values import filled_value
from tests.support.status import snapshot_of

DOCS = Path(__file__).parents[4] / "docs"
NOW_S = 100.0
RECIPIENT = Recipient("10.0.0.1", sees_passphrase=False)
NO_CHANGE = {DETECTIONS, DIAGNOSTICS, *MUX_INPUTS.values()}
"""Sources whose values alone change nothing that the status shows."""

OF_THE_CONFIGURATION: dict[str, SourceSpec[Any]] = {
    "number": number_source("one", "", ANY_NUMBER),
    "text": text_source("one", "", ANY_TEXT),
}
"""A source of each generic kind."""
by_name = pytest.mark.parametrize(
    "spec", [*SOURCES, *OF_THE_CONFIGURATION.values()], ids=lambda spec: spec.name
)


def snapshot(board: Board, *more: SourceSpec[Any]) -> Snapshot:
    known = (*ROS_SOURCES, *OF_THE_CONFIGURATION.values(), *more)
    rules = dict.fromkeys(known, SourceRule(1000, required=False))
    return snapshot_of(board, rules, now_s=NOW_S)


def with_value(spec: SourceSpec[Any], number: int = 1) -> Snapshot:
    return snapshot(Board({spec: Received(filled_value(spec.value_type, number), NOW_S)}), spec)


def columns(page: str, heading: str) -> list[list[str]]:
    """The cells of the table below a heading row."""
    table = (DOCS / page).read_text(encoding="utf-8").split(f"\n{heading}\n")[1].split("\n\n")[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[1:]]


def test_every_generic_kind_has_an_example_here() -> None:
    assert {spec.kind: spec.value_type for spec in GENERIC_KINDS} == {
        kind: spec.value_type for kind, spec in OF_THE_CONFIGURATION.items()
    }


def test_names_are_unique() -> None:
    assert len({spec.name for spec in SOURCES}) == len(SOURCES)
    assert (*ROS_SOURCES, *PLATFORM_SOURCES) == SOURCES


@by_name
def test_a_value_on_the_board_is_in_the_snapshot(spec: SourceSpec[Any]) -> None:
    value = filled_value(spec.value_type)
    board = Board({spec: Received(value, NOW_S - 0.5)})
    assert board[spec] == Received(value, NOW_S - 0.5)
    seen = snapshot(board)[spec]
    assert (seen.value, seen.freshness.age_ms, seen.freshness.fresh) == (value, 500, True)


@by_name
def test_another_value_is_a_change_unless_the_source_is_named(spec: SourceSpec[Any]) -> None:
    one, other = with_value(spec, 1), with_value(spec, 2)
    assert one[spec] != other[spec]
    assert (change_key(one) == change_key(other)) == (spec in NO_CHANGE)


@by_name
def test_losing_the_value_is_a_change(spec: SourceSpec[Any]) -> None:
    """Of sources from the configuration at least the state is shown."""
    assert change_key(snapshot(Board())) != change_key(with_value(spec))


@by_name
def test_a_value_has_a_field_in_the_contract_unless_the_source_is_named(spec: SourceSpec[Any]) -> None:
    without = overlay_snapshot(snapshot(Board()), RECIPIENT)
    given = overlay_snapshot(with_value(spec), RECIPIENT)
    if spec.name == "effective_command":
        assert given.status.effective_command.available, "mapped as the attributed command"
    for message in (without, given):
        if spec.name.startswith("number."):
            assert message.status.numbers[0].HasField("value") == (message is given)
        if spec.name.startswith("text."):
            assert message.status.texts[0].HasField("text") == (message is given)
        message.status.ClearField("sources")
        message.status.ClearField("effective_command")
    assert (without == given) == (spec in NOT_MAPPED)


@pytest.mark.parametrize("spec", ROS_SOURCES, ids=lambda spec: spec.name)
def test_a_source_can_be_configured_and_read(spec: SourceSpec[Any]) -> None:
    types = types_of(spec)
    assert types, f"no reader is registered for {spec.name}: gateway/ros/readers"
    settings = SourceSettings(kind=spec.kind, label=spec.label, topic="/t", type=types[0])
    assert settings.spec is spec
    assert settings.stale_after_ms == spec.stale_after_ms
    assert callable(reader_for(settings))


def test_the_configuration_page_lists_every_kind_with_its_types() -> None:
    heading = "| kind | value | message types | default age limit | in the default list |"
    listed = {row[0]: (row[2], row[3]) for row in columns("configuration.md", heading)}
    assert list(listed) == list(KINDS)
    for spec in GENERIC_KINDS:
        assert listed[spec.kind][1] == f"{spec.stale_after_ms} ms"
    for spec in ROS_SOURCES:
        types, age_limit = listed[spec.kind]
        assert sorted(re.findall(r"`([^`]+)`", types)) == types_of(spec)
        assert age_limit == f"{spec.stale_after_ms} ms"


def test_the_page_on_adding_a_source_lists_every_source() -> None:
    rows = columns("adding-a-source.md", "| source | value type | written by |")
    expected = {
        (f"`{spec.kind}`", f"`{spec.value_type.__name__}`", "ros" if spec in ROS_SOURCES else "platform")
        for spec in SOURCES
    } | {(f"`{spec.kind}`", f"`{spec.value_type.__name__}`", "ros, by label") for spec in GENERIC_KINDS}
    assert {(row[0], row[1], row[2]) for row in rows} == expected


@dataclass(frozen=True, slots=True)
class Gas:
    """A made-up kind, as docs/adding-a-source.md adds one."""

    ppm: float


GAS = SourceSpec("gas", Gas, stale_after_ms=2000)


@contextmanager
def gas_reader() -> Iterator[None]:
    key = ("my_msgs/msg/Gas", GAS)
    reads(*key)(lambda message, _source: Gas(float(message.ppm)))
    try:
        yield
    finally:
        del registry._readers[key]


def test_a_made_up_kind_needs_its_entry_and_a_reader() -> None:
    """Status, freshness, faults' input and change detection follow from the entry."""
    with gas_reader():
        assert types_of(GAS) == ["my_msgs/msg/Gas"]
        value = registry._readers["my_msgs/msg/Gas", GAS](SimpleNamespace(ppm=12), None)  # type: ignore[arg-type]
    assert value
    board = Board()
    waiting = snapshot(board, GAS)
    board[GAS] = Received(value, NOW_S)
    received = snapshot(board, GAS)
    assert received[GAS].value == Gas(12.0)
    assert [view.state for view in (waiting.sources[-1], received.sources[-1])] == [
        SourceState.WAITING,
        SourceState.RECEIVING,
    ]
    assert change_key(waiting) != change_key(received)
    assert overlay_snapshot(received, RECIPIENT).status.sources[-1].name == "gas"
    board[GAS] = Received(Gas(13.0), NOW_S)
    assert change_key(snapshot(board, GAS)) != change_key(received)
