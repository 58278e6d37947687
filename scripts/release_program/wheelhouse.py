"""The wheels of other projects that an installation without a registry needs, in the locked versions."""

import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
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
"""What publishes no wheel. Pure Python, built here by setuptools."""
_LEGACY_PLATFORMS: Final = ("manylinux2014_x86_64", "manylinux2010_x86_64", "manylinux1_x86_64")
"""Names of glibc 2.17, 2.12 and 2.5 before PEP 600."""


@dataclass(frozen=True, slots=True)
class Locked:
    """An entry of a lock file: a requirement, and the SHA-256 of each file that may satisfy it."""

    requirement: Requirement
    hashes: tuple[str, ...]

    def applies_to(self, python: str) -> bool:
        """Returns whether CPython of this version, 3.12 for example, needs it on Linux, x86-64."""
        environment = {
            "python_version": python,
            "python_full_version": f"{python}.0",
            "implementation_name": "cpython",
            "platform_python_implementation": "CPython",
            "os_name": "posix",
            "sys_platform": "linux",
            "platform_system": "Linux",
            "platform_machine": "x86_64",
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


def download(lock: Path, pythons: Iterable[str], wheels: Path, epoch_s: int) -> None:
    """Downloads the wheels of a lock file for Linux on x86-64, each with its hash checked.

    Args:
        lock: of scripts/lock.
        pythons: versions of CPython.
        wheels: where they go; a file that is there is not downloaded again.
        epoch_s: the time of the files in wheels that have to be built: seconds since 1970.

    Raises:
        UserError: the package index does not answer, or has no such wheel.
    """
    entries = list(read_lock(lock.read_text(encoding="utf-8")))
    sources = [entry for entry in entries if entry.requirement.name in SOURCE_ONLY]
    with tempfile.TemporaryDirectory(prefix="robot-release-") as scratch:
        wanted = Path(scratch) / "wanted.txt"
        for python in pythons:
            _write(wanted, (entry for entry in entries if entry not in sources and entry.applies_to(python)))
            _pip(
                *("download", "--only-binary", ":all:", "--dest", wheels, "--requirement", wanted),
                *("--implementation", "cp", "--python-version", python),
                *(word for platform in _platforms() for word in ("--platform", platform)),
            )
        if sources:
            _write(wanted, sources)
            _pip(
                *("wheel", "--no-build-isolation", "--wheel-dir", wheels, "--requirement", wanted),
                environment={"SOURCE_DATE_EPOCH": str(epoch_s)},
            )


def _write(requirements: Path, entries: Iterable[Locked]) -> None:
    requirements.write_text("".join(f"{entry.line()}\n" for entry in entries), encoding="utf-8")


def _platforms() -> Iterator[str]:
    for minor in range(_NEWEST_GLIBC_MINOR, _OLDEST_GLIBC_MINOR - 1, -1):
        yield f"manylinux_2_{minor}_x86_64"
    yield from _LEGACY_PLATFORMS


def _pip(command: str, *words: str | Path, environment: Mapping[str, str] | None = None) -> None:
    run(
        *(sys.executable, "-P", "-m", "pip", "--disable-pip-version-check", "--no-input", command),
        # Twice: without warnings, too, which would hide the reason of a failure.
        *("--quiet", "--quiet", "--no-deps", "--require-hashes", *words),
        within_s=_DOWNLOAD_WITHIN_S,
        environment=environment,
        remedy="Is a package index reached?",
    )
