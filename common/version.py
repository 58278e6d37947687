"""The version of what is installed, and the revision it was built from."""

import os
import re
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

REVISION_VARIABLE: Final = "ROBOT_GATEWAY_REVISION"
"""Set by whoever builds an image, which holds no repository."""
_REVISION: Final = re.compile(r"[0-9a-f]{40}")


def project_version() -> str:
    """MAJOR.MINOR.PATCH of the installed project, "0.0.0" in a tree that was never installed."""
    try:
        return version("robot-gateway")
    except PackageNotFoundError:
        return "0.0.0"


def project_revision(repository: Path = Path(__file__).parents[1] / ".git") -> str:
    """The git revision (40 digits): from the environment, else of the tree; empty when unknown."""
    told = os.environ.get(REVISION_VARIABLE, "").strip().lower()
    found = told or _checked_out(repository)
    return found if _REVISION.fullmatch(found) else ""


def _checked_out(repository: Path) -> str:
    """What HEAD stands for; read from the files, because a robot has no git."""
    try:
        head = (repository / "HEAD").read_text(encoding="ascii").strip()
        reference = head.removeprefix("ref: ")
        if reference == head:
            return head
        loose = repository / reference
        if loose.exists():
            return loose.read_text(encoding="ascii").strip()
        packed = (repository / "packed-refs").read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError):
        return ""
    return next((line.split()[0] for line in packed.splitlines() if line.endswith(f" {reference}")), "")
