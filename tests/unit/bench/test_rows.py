"""Rows survive the way through a file."""

import json

import pytest

from bench.rows import Row


@pytest.mark.parametrize(
    "row",
    [
        Row("soak.fds_growth", "descriptors", "", 0.0, None, 0),
        Row("status.throughput", "calls", "calls/s", 4000.0, 5000.0, 0.85, "higher"),
    ],
)
def test_a_row_of_another_run_is_the_same_row(row: Row) -> None:
    written = json.dumps(row.as_json())
    assert Row.from_json(json.loads(written)) == row


def test_what_is_no_row_is_refused() -> None:
    with pytest.raises(KeyError):
        Row.from_json({"name": "soak.fds_growth"})
