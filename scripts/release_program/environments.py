"""Virtual environments made from a release alone: they prove that it installs without a registry."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from release_program.distributions import Distribution
from release_program.running import run

_INSTALL_WITHIN_S: Final = 300.0


def install(distribution: Distribution, version: str, wheels: Path, environment: Path) -> Path:
    """Installs a distribution with all of its extras from a directory of wheels; returns the interpreter.

    Args:
        distribution: which.
        version: of it.
        wheels: all that it needs.
        environment: a new directory. It gets no pip, so that nothing but the distribution is in it.

    Raises:
        UserError: a wheel is missing, or does not fit this Python.
    """
    interpreter = _new(environment)
    extras = f"[{','.join(distribution.extras)}]" if distribution.extras else ""
    _pip(
        *(interpreter, wheels, f"{distribution.name}{extras}=={version}"),
        remedy="Is a package in pyproject.toml and not in requirements/console.txt? Type: scripts/lock",
    )
    return interpreter


def install_locked(locks: Sequence[Path], files: Path, environment: Path) -> Path:
    """Installs what lock files have from a directory, with hashes checked; returns the interpreter.

    Args:
        locks: of scripts/lock.
        files: wheels and sdists, all that they name for this Python and machine.
        environment: a new directory.

    Raises:
        UserError: a file is missing, or has another hash.
    """
    interpreter = _new(environment)
    for lock in locks:
        _pip(interpreter, files, "--no-deps", "--require-hashes", "--requirement", lock)
    return interpreter


def _new(environment: Path) -> Path:
    run(sys.executable, "-P", "-m", "venv", "--without-pip", environment, within_s=_INSTALL_WITHIN_S)
    return environment / "bin/python"


def _pip(interpreter: Path, files: Path, *words: str | Path, remedy: str = "") -> None:
    run(
        *(sys.executable, "-P", "-m", "pip", "--disable-pip-version-check", "--no-input"),
        *("--python", interpreter, "install", "--quiet", "--no-index", "--find-links", files, "--no-compile"),
        *words,
        within_s=_INSTALL_WITHIN_S,
        environment={"PIP_FIND_LINKS": ""},
        remedy=remedy,
    )
