"""Version, changelog and frozen schema belong to the same release."""

import re
import tomllib
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

ROOT = Path(__file__).parents[2]
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
RELEASES = re.findall(r"^## \[(\d+\.\d+\.\d+)\] - \d{4}-\d{2}-\d{2}$", CHANGELOG, re.MULTILINE)
"""Newest first."""


def test_the_newest_release_is_the_projects_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert RELEASES[0] == project["version"]


def test_the_changelog_lists_releases_once_and_newest_first() -> None:
    headings = re.findall(r"^## \[(.+?)\]", CHANGELOG, re.MULTILINE)
    assert headings == ["Unreleased", *RELEASES]
    numbers = [tuple(int(part) for part in release.split(".")) for release in RELEASES]
    assert numbers == sorted(set(numbers), reverse=True)


@pytest.mark.parametrize("release", RELEASES)
def test_the_schema_of_a_release_is_frozen(release: str) -> None:
    assert (ROOT / f"proto/locked/{release}.binpb").is_file(), "type: scripts/freeze-schema"


def test_the_interface_packages_have_a_released_version() -> None:
    for package in (ROOT / "interfaces").rglob("package.xml"):
        assert ET.parse(package).findtext("version") in RELEASES, package  # noqa: S314  # our own


def test_type_checkers_use_the_clients_annotations() -> None:
    """PEP 561: a package without the marker is untyped to its users."""
    for package in ("console", "common", "proto/python/omniseer"):
        assert (ROOT / package / "py.typed").is_file(), package
