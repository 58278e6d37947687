"""Sections of CHANGELOG.md, in the form of Keep a Changelog 1.1."""

import re
from typing import Final

_HEADING: Final = re.compile(r"^## \[(?P<name>[^\]]+)\](?: - (?P<date>\d{4}-\d{2}-\d{2}))?\s*$", re.MULTILINE)


def section(text: str, name: str) -> tuple[str, str] | None:
    """Returns a section's date and its text without the heading, or None if there is no such section.

    Args:
        text: of the changelog.
        name: a version, or Unreleased, which has no date: "".
    """
    headings = list(_HEADING.finditer(text))
    ends = [*(each.start() for each in headings[1:]), len(text)]
    for heading, end in zip(headings, ends, strict=True):
        if heading["name"] == name:
            return heading["date"] or "", text[heading.end() : end].strip()
    return None


def has_entries(body: str) -> bool:
    """Returns whether a section lists or says anything besides headings."""
    return any(line.strip() and not line.startswith("#") for line in body.splitlines())
