"""Fields of messages as numbers: paths, lists, kinds of numbers, and what is no number."""

import math
from array import array
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.config import SourceSettings
from gateway.ros.readers import reader_for
from gateway.ros.readers.field_path import Step, steps_of, value_at
from gateway.status.values import Number, Text


def number(message: Any, field: str, **more: Any) -> float | None:
    settings = SourceSettings(
        kind="number", label="x", topic="/t", type="any_msgs/msg/Any", field=field, **more
    )
    value = reader_for(settings)(message, settings)
    assert isinstance(value, Number)
    return value.value


CELLS = SimpleNamespace(cells=[SimpleNamespace(voltage=3.3), SimpleNamespace(voltage=3.4)])


def test_a_path_is_names_and_indices() -> None:
    assert steps_of("cells[2].voltage") == (Step("cells", 2), Step("voltage", None))
    assert value_at(CELLS, "cells[1].voltage") == 3.4
    assert value_at(CELLS, "cells[2].voltage") is None, "the list is too short"


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        (3, 3.0),
        (2**64 - 1, float(2**64 - 1)),
        (True, 1.0),
        (b"\x07", 7.0),
        (-0.0, 0.0),
        (math.nan, None),
        (math.inf, None),
        (-math.inf, None),
    ],
)
def test_every_kind_of_number(raw: Any, expected: float | None) -> None:
    assert number(SimpleNamespace(data=raw), "data") == expected


def test_lists_of_rclpy() -> None:
    assert number(SimpleNamespace(data=array("f", [1.5, 2.5])), "data[1]") == 2.5
    assert number(SimpleNamespace(data=[b"\x01"]), "data[0]") == 1.0
    assert number(SimpleNamespace(data=[]), "data[0]") is None


def test_the_unit_of_the_configuration() -> None:
    kelvin = SimpleNamespace(temperature=300.0)
    assert number(kelvin, "temperature", offset=-273.15, decimals=2) == 26.85
    assert number(SimpleNamespace(percentage=0.5), "percentage", scale=100) == 50.0
    assert number(SimpleNamespace(x=1e300), "x", scale=1e300) is None, "beyond what a number can hold"


def test_minus_zero_is_zero() -> None:
    assert math.copysign(1, number(SimpleNamespace(x=-0.001), "x", decimals=1) or 0.0) == 1
    assert math.copysign(1, number(SimpleNamespace(x=-0.0), "x") or 0.0) == 1


def test_smaller_differences_than_are_shown_are_none() -> None:
    assert number(SimpleNamespace(x=20.04), "x", decimals=1) == number(
        SimpleNamespace(x=19.96), "x", decimals=1
    )


def text(message: Any, field: str = "data", **more: Any) -> str | None:
    settings = SourceSettings(
        kind="text", label="x", topic="/t", type="any_msgs/msg/Any", field=field, **more
    )
    value = reader_for(settings)(message, settings)
    assert isinstance(value, Text)
    return value.text


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        ("open", "open"),
        ("  open\n", "open"),
        ("", ""),
        ("two\nlines", "two lines"),
        ("\x1b[2Jgone\x00", "\ufffd[2Jgone\ufffd"),
        ("\udcff", "\ufffd"),
        ("a" * 80, "a" * 80),
        ("a" * 1_000_000, "a" * 79 + "\u2026"),
    ],
)
def test_a_text_is_one_printable_line(raw: str, expected: str) -> None:
    assert text(SimpleNamespace(data=raw)) == expected


def test_names_of_numbers() -> None:
    names = {0: "open", 1: "closed", 255: "jammed"}
    assert [text(SimpleNamespace(data=raw), names=names) for raw in (0, True, b"\xff", 7)] == [
        "open",
        "closed",
        "jammed",
        "7",
    ]
    assert text(SimpleNamespace(data=[]), "data[0]", names=names) is None
