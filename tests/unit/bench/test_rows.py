"""Rows: what they compute of their rounds, what they refuse, and the way through a file."""

import json
from typing import Any

import pytest

from bench.rows import MeasurementError, Row


def row(**changed: Any) -> Row:
    fields: dict[str, Any] = {
        "name": "status.throughput",
        "what": "calls",
        "unit": "calls/s",
        "values": [40.0, 30.0, 50.0, 41.0, 39.0],
        "references": [50.0, 50.0, 50.0, 40.0, 50.0],
        "bar": 0.85,
        "better": "higher",
    }
    return Row(**(fields | changed))


def test_median_ratio_and_spread() -> None:
    measured = row()
    assert (measured.value, measured.reference, measured.ratio) == (40.0, 50.0, 0.8)
    assert measured.spread == (0.6, 1.025)
    assert not measured.ok


def test_without_a_reference_the_bar_and_the_spread_are_on_the_value() -> None:
    measured = row(references=(), bar=40.0)
    assert (measured.reference, measured.ratio) == (None, None)
    assert measured.spread == (30.0, 50.0)
    assert measured.ok


@pytest.mark.parametrize("references", [(), [1.0] * 5])
def test_a_row_without_a_bar_promises_nothing(references: list[float]) -> None:
    assert row(bar=None, references=references).ok


@pytest.mark.parametrize(("better", "worst"), [("lower", 50.0), ("higher", 30.0)])
def test_the_worst_round_is_the_one_farthest_from_the_promise(better: str, worst: float) -> None:
    assert row(references=(), judged="worst", better=better).value == worst


def test_the_worst_ratio_is_judged_where_there_is_a_reference() -> None:
    """Not that of the lowest value, nor one to the median of the references."""
    measured = row(judged="worst", references=[60.0, 30.0, 50.0, 40.0, 40.0])
    assert (measured.value, measured.reference) == (40.0, 60.0)
    assert measured.ratio == measured.spread[0] == pytest.approx(2 / 3)
    assert not measured.ok


def test_all_rounds_together_are_their_sum() -> None:
    measured = row(references=(), judged="sum", values=[0.0, 1.0, 0.0, 0.0, 1.0], better="lower", bar=1)
    assert (measured.value, measured.median, measured.spread) == (2.0, 0.0, (0.0, 1.0))
    assert not measured.ok


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"values": [1.0] * 4, "references": [1.0] * 4}, "too few"),
        ({"values": [], "references": [], "single": True}, "too few"),
        ({"judged": "sum"}, "has no reference"),
        ({"references": [1.0] * 4}, "every round needs its reference"),
        ({"references": [50.0, 50.0, 0.0, 50.0, 50.0]}, "reference of 0"),
    ],
)
def test_rounds_that_make_no_row_are_refused(changed: dict[str, Any], reason: str) -> None:
    with pytest.raises(MeasurementError, match=reason):
        row(**changed)


def test_one_long_round_is_enough_where_the_row_says_so() -> None:
    assert row(values=[0.0], references=(), single=True, better="lower", bar=0).ok


@pytest.mark.parametrize(
    "written",
    [
        row(),
        row(values=[0.0], references=(), single=True, discarded=2, judged="worst"),
        row(bar=None),
    ],
)
def test_a_row_of_another_run_is_the_same_row(written: Row) -> None:
    read = Row.from_json(json.loads(json.dumps(written.as_json())))
    assert read.as_json() == written.as_json()


def test_what_is_no_row_is_refused() -> None:
    with pytest.raises(KeyError):
        Row.from_json({"name": "soak.fds_growth"})
