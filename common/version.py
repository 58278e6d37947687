"""Version and git revision of the installed project."""

import os
import re
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

REVISION_VARIABLE: Final = "ROBOT_GATEWAY_REVISION"
"""Set when an image is built, which contains no repository."""
_REVISION: Final = re.compile(r"[0-9a-f]{40}")


def project_version() -> str:
    """Returns MAJOR.MINOR.PATCH of the installed project; "0.0.0" if it is not installed."""
    try:
        return version("robot-gateway")
    except PackageNotFoundError:
        return "0.0.0"


def project_revision(repository: Path = Path(__file__).parents[1] / ".git") -> str:
    """Returns the git revision (40 digits) of the environment, else of the repository; empty if unknown."""
    found = os.environ.get(REVISION_VARIABLE, "").strip().lower() or _head(repository)
    return found if _REVISION.fullmatch(found) else ""


def _head(repository: Path) -> str:
    """Resolves HEAD from the files of the repository, because a robot has no git."""
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
