"""What an installation without a registry needs of other projects, in the locked versions."""

import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Final

from packaging.requirements import InvalidRequirement, Requirement

from common.errors import UserError
from release_program.running import run

_DOWNLOAD_WITHIN_S: Final = 900.0
_OLDEST_GLIBC_MINOR: Final = 5
_NEWEST_GLIBC_MINOR: Final = 36
"""Debian 12, the oldest system that is supported, has glibc 2.36."""
SOURCE_ONLY: Final = frozenset({"nkeys"})
"""What publishes no wheel. Pure Python, built by setuptools."""
_BACKEND: Final = "setuptools"
_LEGACY_PLATFORMS: Final = {
    "x86_64": ("manylinux2014_x86_64", "manylinux2010_x86_64", "manylinux1_x86_64"),
    "aarch64": ("manylinux2014_aarch64",),
}
"""Names of glibc 2.17, 2.12 and 2.5 before PEP 600, by machine as uname(2) names it."""


@dataclass(frozen=True, slots=True)
class Locked:
    """An entry of a lock file: a requirement, and the SHA-256 of each file that may satisfy it."""

    requirement: Requirement
    hashes: tuple[str, ...]

    def applies_to(self, python: str, machine: str) -> bool:
        """Returns whether CPython of this version, 3.12 for example, needs it on Linux on this machine."""
        environment = {
            "python_version": python,
            "python_full_version": f"{python}.0",
            "implementation_name": "cpython",
            "platform_python_implementation": "CPython",
            "os_name": "posix",
            "sys_platform": "linux",
            "platform_system": "Linux",
            "platform_machine": machine,
            "extra": "",
        }
        return self.requirement.marker is None or self.requirement.marker.evaluate(environment)

    def line(self) -> str:
        """Returns the entry without its condition, on one line."""
        hashes = " ".join(f"--hash=sha256:{digest}" for digest in self.hashes)
        return f"{self.requirement.name}{self.requirement.specifier} {hashes}"


def read_lock(text: str) -> Iterator[Locked]:
    """Yields the entries of a lock file of scripts/lock.

    Raises:
        UserError: an entry can't be read, or has no hash.
    """
    for logical in text.replace("\\\n", " ").splitlines():
        words = logical.partition(" #")[0].split("--hash=sha256:")
        if not words[0].strip() or words[0].startswith("#"):
            continue
        try:
            requirement = Requirement(words[0].strip())
        except InvalidRequirement as error:
            raise UserError(f"no entry of a lock file: {words[0].strip()!r}", "Type: scripts/lock") from error
        if len(words) == 1:
            raise UserError(f"the lock file has no hash of {requirement.name}", "Type: scripts/lock")
        yield Locked(requirement, tuple(word.strip() for word in words[1:]))


def download(locks: Sequence[Path], pythons: Iterable[str], machines: Iterable[str], target: Path) -> None:
    """Downloads the wheels of lock files for Linux, each with its hash checked; none of SOURCE_ONLY.

    Args:
        locks: of scripts/lock. What several have is downloaded once.
        pythons: versions of CPython.
        machines: x86_64, aarch64.
        target: where they go; a file that is there is not downloaded again.

    Raises:
        UserError: the package index does not answer, or has no such wheel.
    """
    entries = [entry for entry in _entries(locks) if entry.requirement.name not in SOURCE_ONLY]
    for python, machine in product(pythons, machines):
        needed = (entry for entry in entries if entry.applies_to(python, machine))
        _pip(
            *("download", "--only-binary", ":all:", "--dest", target),
            *("--implementation", "cp", "--python-version", python),
            *(word for platform in _platforms(machine) for word in ("--platform", platform)),
            requirements=needed,
        )


def build_sources(locks: Sequence[Path], target: Path, epoch_s: int) -> None:
    """Builds the wheels of SOURCE_ONLY that lock files have.

    Args:
        locks: of scripts/lock.
        target: where they go.
        epoch_s: the time of their files: seconds since 1970.

    Raises:
        UserError: the package index does not answer, or the build fails.
    """
    _pip(
        *("wheel", "--no-build-isolation", "--wheel-dir", target),
        requirements=_sources(locks),
        environment={"SOURCE_DATE_EPOCH": str(epoch_s)},
    )


def download_sources(locks: Sequence[Path], builders: Path, target: Path) -> None:
    """Downloads the sdists of SOURCE_ONLY that lock files have, and what builds them; all hashes are checked.

    An installation that compares hashes with a lock file takes no wheel that was built elsewhere.

    Args:
        locks: of scripts/lock.
        builders: a lock file that has the build backend.
        target: where they go.

    Raises:
        UserError: the package index does not answer.
    """
    backend = (entry for entry in _entries([builders]) if entry.requirement.name == _BACKEND)
    _pip("download", "--only-binary", ":all:", "--dest", target, requirements=backend)
    _pip(
        *("download", "--no-build-isolation", "--no-binary", ":all:", "--dest", target),
        requirements=_sources(locks),
    )


def _entries(locks: Sequence[Path]) -> list[Locked]:
    """Returns the entries of lock files, each once."""
    found = {
        str(entry.requirement): entry
        for lock in locks
        for entry in read_lock(lock.read_text(encoding="utf-8"))
    }
    return list(found.values())


def _sources(locks: Sequence[Path]) -> Iterator[Locked]:
    return (entry for entry in _entries(locks) if entry.requirement.name in SOURCE_ONLY)


def _platforms(machine: str) -> Iterator[str]:
    for minor in range(_NEWEST_GLIBC_MINOR, _OLDEST_GLIBC_MINOR - 1, -1):
        yield f"manylinux_2_{minor}_{machine}"
    yield from _LEGACY_PLATFORMS[machine]


def _pip(
    command: str,
    *words: str | Path,
    requirements: Iterable[Locked],
    environment: Mapping[str, str] | None = None,
) -> None:
    lines = [f"{entry.line()}\n" for entry in requirements]
    if not lines:
        return
    with tempfile.TemporaryDirectory(prefix="robot-release-") as scratch:
        wanted = Path(scratch) / "wanted.txt"
        wanted.write_text("".join(lines), encoding="utf-8")
        run(
            *(sys.executable, "-P", "-m", "pip", "--disable-pip-version-check", "--no-input", command),
            # Twice: without warnings, too, which would hide the reason of a failure.
            *("--quiet", "--quiet", "--no-deps", "--require-hashes", *words, "--requirement", wanted),
            within_s=_DOWNLOAD_WITHIN_S,
            environment=environment,
            remedy="Is a package index reached?",
        )
