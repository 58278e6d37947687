"""Sections of the changelog."""

from pathlib import Path

from release_program.changelog import has_entries, section

ROOT = Path(__file__).parents[3]


def test_a_section_ends_where_the_next_begins() -> None:
    second = "- New.\n\n### Sub\n\n- Old."
    text = (
        "# Log\n\n## [Unreleased]\n\n"
        f"## [2.0.0] - 2026-02-02\n\n{second}\n\n## [1.0.0] - 2026-01-01\n\n- First.\n"
    )
    assert section(text, "Unreleased") == ("", "")
    assert section(text, "2.0.0") == ("2026-02-02", second)
    assert section(text, "1.0.0") == ("2026-01-01", "- First.")
    assert section(text, "1.0") is None


def test_headings_alone_are_no_entries() -> None:
    assert not has_entries("### Added\n\n### Fixed\n")
    assert has_entries("### Added\n\n- x\n")


def test_the_projects_own_changelog_can_be_read() -> None:
    found = section((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), "0.1.0")
    assert found
    assert found[0] == "2026-11-21"
    assert has_entries(found[1])
