"""The page of the published rows: what its columns say, and which rows it lacks."""

from dataclasses import replace
from typing import Any

import pytest

from bench.catalogue import NAMES
from bench.remarks import OLDER
from bench.report import page, summary
from bench.results import Conditions, Run
from bench.rows import Row

ON = Conditions(machine="m", system="s", python="3", commit="c", date="2026-01-01", busy_percent=1.5)


def row(**changed: Any) -> Row:
    fields: dict[str, Any] = {"name": "a.one", "what": "w", "unit": "ms", "values": [1.0] * 5, "bar": 2}
    return Row(**(fields | changed))


def cells(shown: Row) -> list[str]:
    (line,) = [line for line in page([Run(ON, (shown,))]).splitlines() if line.startswith("| a.one")]
    return [cell.strip() for cell in line.strip("|").split("|")]


@pytest.mark.parametrize(
    ("changed", "bar", "kept"),
    [
        ({"bar": 2}, "<= 2 ms", "yes"),
        ({"bar": 0.5}, "<= 0.5 ms", "NO"),
        ({"bar": 0.9, "references": [1.0] * 5, "better": "higher"}, ">= 0.9 x", "yes"),
        ({"bar": None}, "", ""),
    ],
)
def test_bar_and_kept(changed: dict[str, Any], bar: str, kept: str) -> None:
    found = cells(row(**changed))
    assert (found[-3], found[-1]) == (bar, kept)


@pytest.mark.parametrize(("discarded", "rounds"), [(0, "5"), (2, "5 + 2")])
def test_rounds_that_do_not_count_are_counted(discarded: int, rounds: str) -> None:
    assert cells(row(discarded=discarded))[-2] == rounds


def test_the_median_stands_beside_the_worst_round() -> None:
    shown = row(values=[1.0, 2.0, 3.0, 4.0, 9.0], judged="worst")
    assert cells(shown)[2] == "9 ms (median 3)"
    assert summary(shown) == "9 ms (median 3); promised <= 2 ms: NO"


def test_a_run_names_its_conditions() -> None:
    lines = page([Run(ON, (row(),))]).splitlines()
    assert "## 2026-01-01, commit c" in lines
    assert any(line.startswith("m, s, Python 3. ") and " 1.5 % of the time" in line for line in lines)


def test_rows_without_a_figure_are_named() -> None:
    shown = page([Run(ON, (row(name=NAMES[0]),))])
    lacking = shown.partition("## Not published")[2]
    assert f"`{NAMES[0]}`" not in lacking
    assert all(f"`{name}`" in lacking for name in NAMES[1:])
    assert "No figure is published yet" not in shown
    assert "No figure is published yet" in page([])


def test_figures_that_were_measured_in_another_way_are_remarked_until_they_are_measured_anew() -> None:
    older = OLDER[0]
    before = replace(ON, commit=min(older.commits))
    both = [Run(before, (row(name="drive.cpu"), row(name="status.tls"))), Run(ON, (row(name="idle.cpu"),))]
    assert f"- `drive.*`: at commit {before.commit} {older.text}" in page(both).splitlines()
    assert older.text not in page([Run(ON, (row(name="drive.cpu"),)), Run(before, (row(name="status.tls"),))])
