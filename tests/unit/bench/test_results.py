"""The published figures: how a run replaces earlier rows."""

from pathlib import Path

from bench.results import Run, ground, merged, published, write
from bench.rows import Row


def run(*names: str, date: str = "2026-01-01") -> Run:
    on = {"machine": "m", "system": "s", "python": "3", "commit": "c", "date": date}
    return Run(on, tuple(Row(name=name, what="w", unit="ms", values=[1.0] * 5, bar=2) for name in names))


def names(runs: list[Run]) -> list[list[str]]:
    return [[row.name for row in each.rows] for each in runs]


def test_rows_that_are_measured_again_replace_the_earlier_ones() -> None:
    runs = merged([run("a.one", "a.two"), run("b.one")], run("b.one", "a.two", date="2026-01-02"))
    assert names(runs) == [["a.one"], ["b.one", "a.two"]]


def test_what_is_written_is_read(tmp_path: Path) -> None:
    runs = [run("a.one"), run("b.one")]
    write(runs, tmp_path / "figures.json")
    assert [each.as_json() for each in published(tmp_path / "figures.json")] == [
        each.as_json() for each in runs
    ]
    assert published(tmp_path / "none.json") == []


def test_the_ground_names_machine_commit_and_date() -> None:
    on = ground()
    assert all(on[name] for name in ("machine", "system", "python", "commit", "date"))
