"""The published figures: how a run replaces earlier rows, and what it says of its conditions."""

import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bench.results import Conditions, Run, commit, merged, published, read_rows, write, write_rows
from bench.rows import Row

ON = Conditions(machine="m", system="s", python="3", commit="c", date="2026-01-01", busy_percent=1.0)
LATER = replace(ON, date="2026-01-02", busy_percent=3.0)
NEXT_COMMIT = replace(LATER, commit="d")
ORDER = ("a.one", "a.two", "b.one", "b.two")


def row(name: str, value: float = 1.0) -> Row:
    return Row(name=name, what="w", unit="ms", values=[value] * 5, bar=2)


def run(*names: str, on: Conditions = ON) -> Run:
    return Run(on, tuple(map(row, names)))


def names(runs: list[Run]) -> list[list[str]]:
    return [[row.name for row in each.rows] for each in runs]


def test_rows_that_are_measured_again_replace_the_earlier_ones() -> None:
    runs = merged([run("a.one", "a.two"), run("b.one")], run("b.one", "a.two", on=NEXT_COMMIT), ORDER)
    assert names(runs) == [["a.one"], ["b.one", "a.two"]]


def test_what_was_measured_of_one_commit_is_one_run() -> None:
    earlier = [run("b.one", "b.two"), run("a.one", on=NEXT_COMMIT)]
    (other, joined) = merged(earlier, Run(LATER, (row("a.two"), row("b.two", 9.0))), ORDER)
    assert names([other, joined]) == [["a.one"], ["a.two", "b.one", "b.two"]]
    assert joined.rows[-1].value == 9.0
    assert joined.on == replace(ON, date="2026-01-01 to 2026-01-02", busy_percent=3.0)


def test_the_dates_of_three_days_are_the_first_and_the_last() -> None:
    third = replace(ON, date="2026-01-03", busy_percent=None)
    joined = LATER.joined(third).joined(ON)
    assert (joined.date, joined.busy_percent) == ("2026-01-01 to 2026-01-03", 3.0)


@pytest.mark.parametrize("changed", [{"machine": "n"}, {"commit": "d"}, {"python": "4"}])
def test_another_machine_or_commit_is_another_run(changed: dict[str, Any]) -> None:
    assert len(merged([run("a.one")], run("a.two", on=replace(ON, **changed)), ORDER)) == 2


def test_rows_that_no_benchmark_has_any_more_are_left_out() -> None:
    assert names(merged([run("a.one", "a.gone")], run("b.one"), ORDER)) == [["a.one", "b.one"]]
    assert names(merged([run("a.gone")], run("b.one", on=NEXT_COMMIT), ORDER)) == [["b.one"]]


def test_what_is_written_is_read(tmp_path: Path) -> None:
    runs = [run("a.one"), run("b.one", on=NEXT_COMMIT)]
    write(runs, tmp_path / "figures.json")
    assert [each.as_json() for each in published(tmp_path / "figures.json")] == [
        each.as_json() for each in runs
    ]
    assert published(tmp_path / "none.json") == []
    write_rows(runs[0].rows, tmp_path / "rows.json")
    assert [each.as_json() for each in read_rows(tmp_path / "rows.json")] == [
        each.as_json() for each in runs[0].rows
    ]


def test_the_conditions_name_machine_commit_and_date() -> None:
    on = Conditions.now()
    assert all((on.machine, on.system, on.python, on.commit, on.date))
    assert on.busy_percent is None or 0 <= on.busy_percent <= 101


ABOUT_FIGURES = ("docs/benchmarks.json", "docs/benchmarks.md", "CHANGELOG.md", "bench/remarks.py")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    git(tmp_path, "init", "--quiet")
    for file in ("program.py", *ABOUT_FIGURES):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text("first")
    commit_all(tmp_path)
    return tmp_path


def git(root: Path, *arguments: str) -> None:
    who = ("-c", "user.name=bench", "-c", "user.email=bench@localhost", "-c", "commit.gpgsign=false")
    subprocess.run(["git", *who, *arguments], cwd=root, check=True)


def commit_all(root: Path) -> None:
    git(root, "add", ".")
    git(root, "commit", "--quiet", "--no-verify", "--message", "change")


def test_to_publish_and_to_explain_changes_nothing_that_is_measured(checkout: Path) -> None:
    measured = commit(checkout)
    for file in ABOUT_FIGURES:
        (checkout / file).write_text("published")
        assert commit(checkout) == measured
    commit_all(checkout)
    assert commit(checkout) == measured


def test_changes_stand_behind_the_commit(checkout: Path) -> None:
    measured = commit(checkout)
    (checkout / "program.py").write_text("changed")
    assert commit(checkout) == f"{measured}+changes"
    commit_all(checkout)
    assert commit(checkout) not in (measured, f"{measured}+changes")


def test_no_checkout_has_no_commit(tmp_path: Path) -> None:
    assert commit(tmp_path) == "no checkout"
