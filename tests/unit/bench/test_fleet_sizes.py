"""The table of sizes in docs/fleet.md: generated where all of its rows are published, else left as it is."""

from pathlib import Path

import pytest

from bench.fleet_sizes import BEGIN, END, SIZES, table, write, written
from bench.results import Conditions, Run
from bench.rows import Row

ON = Conditions(machine="m, 2 cores", system="s", python="3", commit="c", date="2026-01-01", busy_percent=0.0)
FIGURES = {
    "fleet.hub_10_cpu": 1.06,
    "fleet.hub_10_mib": 21.6,
    "fleet.hub_100_cpu": 6.7,
    "fleet.hub_100_mib": 33.2,
    "fleet.hub_1000_cpu": 14.9,
    "fleet.hub_1000_mib": 133.3,
    "fleet.event_disk_bytes": 250.0,
}


def published(*left_out: str) -> list[Run]:
    rows = [
        Row(name=name, what="w", unit="", values=[figure] * 5, bar=None)
        for name, figure in FIGURES.items()
        if name not in left_out
    ]
    return [Run(ON, tuple(rows))]


def test_each_size_has_its_measured_figures() -> None:
    made = table(published())
    assert made is not None
    assert "(2026-01-01, commit c, m, 2 cores)" in made
    # A state a second and an event a minute; 43200 events of 250 bytes in 30 days.
    assert "| 10 | 10 | 1.1 % of a core | 22 MiB | 0.1 GB |" in made
    assert "| 100 | 102 | 6.7 % of a core | 33 MiB | 1.1 GB |" in made
    assert "| 1000 | 1017 | 15 % of a core | 133 MiB | 10.8 GB |" in made
    lines = made.splitlines()
    assert {line.count("|") for line in lines[2:]} == {7}
    assert len(lines) == 4 + len(SIZES)


def test_it_replaces_what_is_between_the_lines_and_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "fleet.md"
    file.write_text(f"before\n{BEGIN}old\n{END}after\n")
    write(published(), file)
    assert written(file) == table(published())
    assert file.read_text() == f"before\n{BEGIN}{table(published())}{END}after\n"


@pytest.mark.parametrize("name", FIGURES)
def test_without_all_of_its_rows_the_document_stays(tmp_path: Path, name: str) -> None:
    file = tmp_path / "fleet.md"
    file.write_text(f"{BEGIN}old\n{END}")
    write(published(name), file)
    assert written(file) == "old\n"


def test_a_document_without_the_lines_is_an_error(tmp_path: Path) -> None:
    file = tmp_path / "fleet.md"
    file.write_text("nothing\n")
    with pytest.raises(ValueError, match="has no lines"):
        write(published(), file)
