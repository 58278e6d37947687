"""docs/benchmarks.md is what the committed figures say; documents name rows that exist."""

import re
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

from bench import fleet_sizes
from bench.catalogue import GROUPS, NAMES
from bench.remarks import OLDER, REMARKS
from bench.report import PAGE, page
from bench.results import CHANGED, RESULTS, published

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
ROWS = [row for run in published() for row in run.rows]


def test_the_page_is_generated_from_the_figures() -> None:
    assert RESULTS.exists()
    assert PAGE.read_text(encoding="utf-8") == page(published()), "scripts/bench --page generates it"


def test_the_table_of_sizes_is_generated_from_the_figures() -> None:
    made = fleet_sizes.table(published())
    # Where its rows are not published yet, the document says so.
    assert made is None or fleet_sizes.written() == made, "scripts/bench --page generates it"
    assert (made is None) == ("Until these sizes are measured" in fleet_sizes.written())


def test_every_published_row_exists_once() -> None:
    names = [row.name for row in ROWS]
    assert sorted(set(names)) == sorted(names)
    assert [name for name in names if name not in NAMES] == []


def test_every_figure_names_the_commit_that_was_measured() -> None:
    assert [run.on.commit for run in published() if run.on.commit.endswith(CHANGED)] == []


def test_every_promise_that_is_not_kept_has_its_reason() -> None:
    explained = {name for about in REMARKS for name in about}
    assert [row.name for row in ROWS if not row.ok and row.name not in explained] == []


def test_remarks_are_about_rows_that_exist() -> None:
    assert [name for about in REMARKS for name in about if name not in NAMES] == []


def test_what_is_said_of_older_figures_is_of_rows_that_exist() -> None:
    patterns = [pattern for one in OLDER for pattern in one.rows]
    assert [each for each in patterns if not any(fnmatchcase(name, each) for name in NAMES)] == []


def named(document: Path) -> set[str]:
    """Rows and groups behind `scripts/bench`, and patterns of row names, in a document."""
    text = document.read_text(encoding="utf-8")
    commands = re.findall(r"`scripts/bench((?: [a-z][a-z0-9_.]*)+)", text)
    patterns = re.findall(rf"`((?:{'|'.join(GROUPS)})\.[a-z0-9_]*\*[a-z0-9_*]*)`", text)
    return {word for command in commands for word in command.split()} | set(patterns)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_documents_name_benchmarks_that_exist(document: Path) -> None:
    known = (*GROUPS, *NAMES)
    assert [word for word in named(document) if not any(fnmatchcase(name, word) for name in known)] == []
