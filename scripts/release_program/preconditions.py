"""What has to hold before anything is built: one table of refusals."""

import re
from dataclasses import dataclass
from typing import Final

from release_program.changelog import has_entries, section

_VERSION: Final = re.compile(r"(0|[1-9]\d*)\.(0|[1-9]\d*)\.(0|[1-9]\d*)")
"""MAJOR.MINOR.PATCH (docs/decisions/0010-version-in-pyproject.md)."""
_NAMED_FILES: Final = 5
"""Of those that are not committed."""


@dataclass(frozen=True, slots=True)
class Facts:
    """The state of a repository.

    Attributes:
        project_version: of pyproject.toml.
        changelog: the text of CHANGELOG.md.
        changed_files: what is not committed.
        has_frozen_schema: whether the version's schema is in proto/locked.
        revision: the commit that is checked out.
        tagged_revision: the commit that the version's tag names; "" without that tag.
        machine: this computer's processor, as uname(1) has it.
    """

    project_version: str
    changelog: str
    changed_files: tuple[str, ...]
    has_frozen_schema: bool
    revision: str
    tagged_revision: str
    machine: str


def refusals(version: str, facts: Facts) -> list[str]:
    """Returns why this version can't be released from this state, one sentence each; empty if it can."""
    if not _VERSION.fullmatch(version):
        return [f"{version!r} is no version: MAJOR.MINOR.PATCH, for example 1.4.0"]
    found = []
    if facts.machine != "x86_64":
        found.append(f"this computer is {facts.machine}, and a release is made on x86-64; type it there")
    if version != facts.project_version:
        found.append(f"pyproject.toml has version {facts.project_version}: set it to {version}")
    found += _of_changelog(version, facts.changelog)
    if not facts.has_frozen_schema:
        found.append(f"proto/locked/{version}.binpb is missing: type scripts/freeze-schema")
    if facts.changed_files:
        named = ", ".join(facts.changed_files[:_NAMED_FILES])
        more = len(facts.changed_files) - _NAMED_FILES
        found.append(f"not committed: {named}{f' and {more} more' if more > 0 else ''}")
    if facts.tagged_revision not in ("", facts.revision):
        found.append(f"v{version} names another commit, {facts.tagged_revision[:12]}: raise the version")
    return found


def _of_changelog(version: str, text: str) -> list[str]:
    released, unreleased = section(text, version), section(text, "Unreleased")
    found = []
    if released is None:
        found.append(f'CHANGELOG.md has no section "## [{version}] - DATE"')
    elif not released[0]:
        found.append(f"CHANGELOG.md has no date in the heading of {version}")
    elif not has_entries(released[1]):
        found.append(f"the section {version} of CHANGELOG.md is empty")
    if unreleased and has_entries(unreleased[1]):
        found.append(f'CHANGELOG.md has entries under "Unreleased": they belong to {version}, too')
    return found
