"""Builds sdist and wheel of a distribution, the same bytes from the same commit."""

import shutil
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Final

from release_program.distributions import Distribution, pyproject
from release_program.modules import SourceFile, closure
from release_program.running import run

_BUILD_WITHIN_S: Final = 300.0


def build(staged: Path, sdists: Path, wheels: Path, epoch_s: int) -> None:
    """Builds the sdist of a distribution into `sdists`, and from it the wheel into `wheels`.

    Args:
        staged: the source tree that `stage` has written.
        sdists: a directory.
        wheels: a directory.
        epoch_s: the time that all files get: seconds since 1970 (https://reproducible-builds.org/specs/source-date-epoch).

    Raises:
        UserError: the build failed.
    """
    with tempfile.TemporaryDirectory(prefix="robot-release-") as scratch:
        built = Path(scratch)
        run(
            *(sys.executable, "-P", "-m", "build", "--no-isolation", "--outdir", built, staged),
            within_s=_BUILD_WITHIN_S,
            environment={"SOURCE_DATE_EPOCH": str(epoch_s), "PYTHONHASHSEED": "0"},
        )
        (sdist,), (wheel,) = built.glob("*.tar.gz"), built.glob("*.whl")
        shutil.move(sdist, sdists)
        shutil.move(wheel, wheels)


def files_of(distribution: Distribution, tree: Path) -> frozenset[SourceFile]:
    """Returns the files of a distribution, without those of the one that it builds on."""
    files = closure(tree, distribution.entries)
    return files - files_of(distribution.builds_on, tree) if distribution.builds_on else files


def stage(distribution: Distribution, tree: Path, target: Path) -> None:
    """Writes the source tree of a distribution, with a pyproject.toml of its own.

    Args:
        distribution: which.
        tree: the project's source tree, with committed files and no others.
        target: a new directory.
    """
    for boundary in (".git", ".hg"):
        # Hatchling would take the .gitignore of whatever repository this is in, and looks for it up to here.
        (target / boundary).mkdir(parents=True)
    files = files_of(distribution, tree)
    for file in files:
        destination = target / file.installed
        destination.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(tree / file.source, destination)
    shutil.copyfile(tree / "LICENSE", target / "LICENSE")
    shutil.copyfile(tree / distribution.readme, target / "README.md")
    project = tomllib.loads((tree / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    packages = sorted({file.installed.parts[0] for file in files})
    (target / "pyproject.toml").write_text(pyproject(distribution, project, packages), encoding="utf-8")
