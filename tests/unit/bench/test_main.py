"""`scripts/bench`: what it measures, publishes and leaves out, and how it ends. Nothing is measured here."""

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from bench import __main__ as program
from bench import fleet_sizes, report, results
from bench.catalogue import Part
from bench.results import Conditions
from bench.rows import Row

HERE = Conditions(machine="m", system="s", python="3", commit="c", date="2026-01-01", busy_percent=0.0)


class Bench:
    """The program, with the measuring replaced.

    Attributes:
        asked: names of the rows that were to be measured, part by part.
        lacking: rows that fail.
        on: conditions of the measurements.
    """

    def __init__(self, directory: Path) -> None:
        self.asked: list[tuple[str, ...]] = []
        self.lacking: set[str] = set()
        self.on = HERE
        self.before: Callable[[], None] = lambda: None
        self.json = directory / "benchmarks.json"
        self.page = directory / "benchmarks.md"
        self.document = directory / "fleet.md"

    def measured(self, _part: Part, names: Sequence[str]) -> list[Row]:
        self.asked.append(tuple(names))
        self.before()
        return [
            Row(name=name, what="w", unit="ms", values=[1 / 3] * 5, bar=1)
            for name in names
            if name not in self.lacking
        ]

    def __call__(self, *arguments: str) -> int:
        self.asked.clear()
        sys.argv = ["scripts/bench", *arguments]
        return program.main()

    @property
    def published(self) -> list[str]:
        return [row.name for run in results.published() for row in run.rows]


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    made = Bench(tmp_path)
    monkeypatch.setattr(sys, "argv", [])
    monkeypatch.setattr(program, "measured", made.measured)
    monkeypatch.setattr(Conditions, "now", lambda: made.on)
    monkeypatch.setattr(results, "commit", lambda: made.on.commit)
    for module, name, file in (
        (results, "published", made.json),
        (results, "write", made.json),
        (report, "write_page", made.page),
        (fleet_sizes, "write", made.document),
    ):
        monkeypatch.setattr(module, name, partial(getattr(module, name), file=file))
    return made


def test_a_part_is_published_as_soon_as_it_is_measured(bench: Bench) -> None:
    seen = []
    bench.before = lambda: seen.append(bench.published)
    assert bench("status.tls", "status.p99", "--publish") == 0
    assert seen == [[], ["status.tls"]]
    assert bench.published == ["status.tls", "status.p99"]
    # The figures are rounded in the file: the page is of these.
    assert bench.page.read_text() == report.page(results.published())


def test_what_fails_keeps_nothing_else_from_being_measured_and_fails_the_run(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    bench.lacking = {"status.tls", "watch.cpu_100"}
    assert bench("status", "watch", "--publish") == 1
    assert bench.published == [
        "status.throughput",
        "status.cpu_per_call",
        "status.p99",
        "status.cpu_per_call_real",
        "watch.served_100",
        "watch.p99_healthy",
    ]
    assert "not measured, see above: status.tls watch.cpu_100" in capsys.readouterr().err


def test_missing_leaves_out_what_is_published_of_this_commit(bench: Bench) -> None:
    bench.lacking = {"status.tls"}
    assert bench("status", "--publish") == 1
    bench.lacking = set()
    assert bench("status", "--publish", "--missing") == 0
    assert bench.asked == [("status.tls",)]
    assert bench("status", "--missing") == 0
    assert bench.asked == []
    bench.on = replace(HERE, commit="d")
    assert bench("status", "--missing") == 0
    assert len(bench.asked) == 4


def test_how_long_it_will_take_is_said(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    bench("cli", "soak.fds_growth")
    said = capsys.readouterr().err
    assert "cli: about 1 min" in said
    assert "all of it: about 32 min" in said


@pytest.mark.parametrize("word", ["status.typo", "video.excess_latency_20", "nothing"])
def test_an_unknown_row_is_an_error_of_usage(bench: Bench, word: str) -> None:
    with pytest.raises(SystemExit) as ended:
        bench("status", word)
    assert ended.value.code == 2
    assert bench.asked == []


def test_a_changed_checkout_is_not_published(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    bench.on = replace(HERE, commit="c+changes")
    with pytest.raises(SystemExit) as ended:
        bench("status", "--publish")
    assert ended.value.code == 2
    assert "commit them first" in capsys.readouterr().err


def test_a_checkout_that_changes_meanwhile_ends_the_measuring(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    def change() -> None:
        bench.on = replace(HERE, commit="c+changes")

    bench.before = change
    assert bench("status.tls", "status.p99", "--publish") == 1
    assert bench.published == ["status.tls"]
    assert "c has become c+changes" in capsys.readouterr().err


def test_a_promise_that_is_not_kept_fails_the_run(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    late = Row(name="cli.start_ms", what="w", unit="ms", values=[300.0] * 5, bar=250)
    monkeypatch.setattr(program, "measured", lambda *_: [late])
    assert bench("cli.start_ms") == 1


def test_the_json_file_has_machine_commit_date_and_rows(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "run.json"
    assert bench("status.tls", "cli.start_ms", "--json", str(file)) == 0
    found = json.loads(file.read_text())
    assert {"machine", "commit", "date"} <= set(found["on"])
    assert [row["name"] for row in found["rows"]] == ["status.tls", "cli.start_ms"]
    assert not bench.json.exists()
