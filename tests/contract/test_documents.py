"""The documents' links, file names and numbering are valid."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "proto").rglob("*.md")],
    key=lambda path: path.relative_to(ROOT),
)
DECISIONS = sorted((ROOT / "docs/decisions").glob("0*.md"))


def anchors(document: Path) -> set[str]:
    """Anchors of the headings, by GitHub's rules."""
    headings = re.findall(r"^#+ (.+)$", document.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_relative_links_lead_somewhere(document: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", document.read_text(encoding="utf-8")):
        if "://" in link:
            continue
        path, _, anchor = link.partition("#")
        target = document.parent / path if path else document
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_ffplay_is_given_its_latency_in_microseconds(document: Path) -> None:
    latencies = re.findall(r"ffplay.*[?&]latency=(\d+)", document.read_text(encoding="utf-8"))
    assert [each for each in latencies if int(each) < 1000] == []


def test_the_contributors_guide_names_files_that_exist() -> None:
    guide = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = set(
        re.findall(r"`((?:bench|console|docs|fuzz|gateway|preview|proto|scripts|tests)/[\w./-]+)`", guide)
    )
    assert named
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []


def test_decisions_are_numbered_and_listed_in_order() -> None:
    numbers = [int(record.name[:4]) for record in DECISIONS]
    assert numbers == list(range(1, len(DECISIONS) + 1))
    index = (ROOT / "docs/decisions/README.md").read_text(encoding="utf-8")
    assert re.findall(r"\]\((0\d{3}-[\w-]+\.md)\)", index) == [record.name for record in DECISIONS]


@pytest.mark.parametrize("record", DECISIONS, ids=lambda path: path.stem)
def test_a_decision_is_one_page_of_context_decision_and_consequences(record: Path) -> None:
    text = record.read_text(encoding="utf-8")
    assert re.findall(r"^## (.+)$", text, re.MULTILINE) == ["Context", "Decision", "Consequences"]
    assert re.match(rf"# {record.name[:4]}: .+\n\nStatus: ", text)
    assert len(text.splitlines()) <= 50
