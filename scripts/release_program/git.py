"""The repository: the commit that is released, and its files."""

import gzip
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from release_program.running import run

_WITHIN_S: Final = 120.0
_NOT_SOURCES: Final = (":(exclude).env", ":(exclude)docker/vendor/*.deb")
"""What the builder's robot adds to a tree, by docs/deploy.md: its settings and its board's packages."""


@dataclass(frozen=True, slots=True)
class Commit:
    """A commit.

    Attributes:
        revision: 40 hexadecimal digits.
        epoch_s: when it was committed, in seconds since 1970.
    """

    revision: str
    epoch_s: int


def head(root: Path) -> Commit:
    """Returns the checked-out commit.

    Raises:
        UserError: there is no repository, or no git.
    """
    revision, epoch = run(
        *("git", "-C", root, "log", "-1", "--format=%H %ct"),
        within_s=_WITHIN_S,
        remedy="A release is made from a commit: clone the repository",
    ).split()
    return Commit(revision, int(epoch))


def changed_files(root: Path) -> tuple[str, ...]:
    """Returns the files that differ from the commit, new ones included."""
    listed = run(
        *("git", "-C", root, "status", "--porcelain", "--untracked-files=all", "--", ".", *_NOT_SOURCES),
        within_s=_WITHIN_S,
    )
    return tuple(line[3:] for line in listed.splitlines())


def tagged(root: Path, tag: str) -> str:
    """Returns the revision that a tag names, or "" if there is no such tag."""
    listed = run(
        "git", "-C", root, "tag", "--list", tag, "--format=%(objectname) %(*objectname)", within_s=_WITHIN_S
    )
    # An annotated tag names its commit second.
    return listed.split()[-1] if listed.split() else ""


def archive(root: Path, commit: Commit, prefix: str, target: Path) -> None:
    """Writes the commit's files as a gzip-compressed tar archive, the same bytes each time.

    Args:
        root: of the repository.
        commit: which.
        prefix: the directory inside of the archive.
        target: the file to write.

    Raises:
        UserError: git failed.
    """
    with tempfile.TemporaryDirectory(prefix="robot-release-") as scratch:
        tar = Path(scratch) / "tree.tar"
        run(
            *("git", "-C", root, "-c", "tar.umask=0022", "archive", "--format=tar", f"--prefix={prefix}/"),
            *("--output", tar, commit.revision),
            within_s=_WITHIN_S,
        )
        # No file name and no time in the header (RFC 1952, 2.3).
        with (
            tar.open("rb") as plain,
            target.open("wb") as file,
            gzip.GzipFile(filename="", mode="wb", compresslevel=9, fileobj=file, mtime=0) as packed,
        ):
            shutil.copyfileobj(plain, packed)


def export(archived: Path, target: Path) -> Path:
    """Unpacks an archive of `archive` and returns the tree in it."""
    target.mkdir(parents=True)
    run("tar", "--extract", "--file", archived, "--directory", target, within_s=_WITHIN_S)
    (tree,) = target.iterdir()
    return tree
