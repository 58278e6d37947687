"""What is refused before anything is built."""

from dataclasses import replace
from typing import Any

import pytest
from release_program.preconditions import Facts, refusals

CHANGELOG = """# Changelog

## [Unreleased]

## [1.2.0] - 2026-12-01

### Added

- A thing.

## [1.1.0]

- No date.

## [1.0.0] - 2026-01-01

### Added
"""
GOOD = Facts("1.2.0", CHANGELOG, (), True, "a" * 40, "", "x86_64")


def test_a_clean_commit_with_its_section_may_be_released() -> None:
    assert refusals("1.2.0", GOOD) == []


def test_a_tag_on_this_commit_is_no_obstacle() -> None:
    assert refusals("1.2.0", replace(GOOD, tagged_revision="a" * 40)) == []


@pytest.mark.parametrize(
    "version", ["", "1.2", "v1.2.0", "1.2.0rc1", "01.2.0", "1.2.0\n", "1.2.0 --output /", "../1"]
)
def test_what_is_no_version_is_refused_alone(version: str) -> None:
    (only,) = refusals(version, GOOD)
    assert "is no version" in only


@pytest.mark.parametrize(
    ("version", "changed", "said"),
    [
        ("1.2.0", {"project_version": "1.1.0"}, "pyproject.toml has version 1.1.0: set it to 1.2.0"),
        ("1.2.0", {"changed_files": ("a", "b")}, "not committed: a, b"),
        (
            "1.2.0",
            {"machine": "aarch64"},
            "this computer is aarch64, and a release is made on x86-64; type it there",
        ),
        ("1.2.0", {"changed_files": tuple("abcdefg")}, "not committed: a, b, c, d, e and 2 more"),
        (
            "1.2.0",
            {"has_frozen_schema": False},
            "proto/locked/1.2.0.binpb is missing: type scripts/freeze-schema",
        ),
        (
            "1.2.0",
            {"tagged_revision": "b" * 40},
            "v1.2.0 names another commit, bbbbbbbbbbbb: raise the version",
        ),
        ("1.3.0", {"project_version": "1.3.0"}, 'CHANGELOG.md has no section "## [1.3.0] - DATE"'),
        ("1.1.0", {"project_version": "1.1.0"}, "CHANGELOG.md has no date in the heading of 1.1.0"),
        ("1.0.0", {"project_version": "1.0.0"}, "the section 1.0.0 of CHANGELOG.md is empty"),
        (
            "1.2.0",
            {
                "changelog": CHANGELOG.replace(
                    "## [Unreleased]\n", "## [Unreleased]\n\n### Fixed\n\n- More.\n"
                )
            },
            'CHANGELOG.md has entries under "Unreleased": they belong to 1.2.0, too',
        ),
    ],
)
def test_each_obstacle_is_one_sentence(version: str, changed: dict[str, Any], said: str) -> None:
    assert refusals(version, replace(GOOD, **changed)) == [said]


def test_all_obstacles_are_named_at_once() -> None:
    found = refusals("1.3.0", replace(GOOD, changed_files=("x",), has_frozen_schema=False))
    assert len(found) == 4
