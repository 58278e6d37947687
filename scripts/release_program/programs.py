"""What robots without Docker need of other projects, for scripts/install-robot --release.

ROS 2, GStreamer and Python are the robot's own, by its Debian packages; the programs are in the source tree.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Final

from release_program import wheelhouse
from release_program.environments import install_locked

PROGRAMS: Final = ("gateway", "recorder", "bridge", "preview-image")
"""The lock files that scripts/install-robot installs, in requirements."""
_TOOLS: Final = "tools"
"""What it installs them with, and builds the project's own wheel."""
_BACKENDS: Final = "release"
_MACHINES: Final = ("x86_64", "aarch64")


def download(tree: Path, pythons: Iterable[str], target: Path) -> None:
    """Downloads it for Linux on x86-64 and arm64.

    Args:
        tree: the project's source tree.
        pythons: versions of CPython.
        target: a directory.

    Raises:
        UserError: the package index does not answer, or lacks something.
    """
    wheelhouse.download(_locks(tree, *PROGRAMS, _TOOLS), pythons, _MACHINES, target)
    (backends,) = _locks(tree, _BACKENDS)
    wheelhouse.download_sources(_locks(tree, *PROGRAMS), backends, target)


def install(tree: Path, files: Path, environment: Path) -> Path:
    """Installs it for this Python without a registry; returns the interpreter.

    Args:
        tree: the project's source tree.
        files: that `download` has made.
        environment: a new directory.

    Raises:
        UserError: something is missing.
    """
    return install_locked(_locks(tree, *PROGRAMS), files, environment)


def _locks(tree: Path, *names: str) -> list[Path]:
    return [tree / f"requirements/{name}.txt" for name in names]
