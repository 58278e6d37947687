"""The page of the published rows: what the columns bar and kept say."""

from typing import Any

import pytest

from bench.report import page
from bench.results import Run
from bench.rows import Row

ON = {"machine": "m", "system": "s", "python": "3", "commit": "c", "date": "2026-01-01"}


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
    row = Row(**({"name": "a.one", "what": "w", "unit": "ms", "values": [1.0] * 5} | changed))
    (line,) = [line for line in page([Run(ON, (row,))]).splitlines() if line.startswith("| a.one")]
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert (cells[-3], cells[-1]) == (bar, kept)
