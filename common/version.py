"""Version and git revision of the running program.

The version has one home, pyproject.toml, and is read from the installed distribution's metadata. The
revision names the exact commit (docs/decisions/0010-version-in-pyproject.md).
"""

import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Final

REVISION_VARIABLE: Final = "ROBOT_GATEWAY_REVISION"
"""Environment variable that holds the revision; set in container images, which contain no repository."""
_DISTRIBUTIONS: Final = ("robot-gateway", "robot-gateway-client")
"""Those that have this module: the whole project, and the client library, which robotctl's own builds on."""
_REVISION: Final = re.compile(r"[0-9a-f]{40}")


def project_version() -> str:
    """Returns MAJOR.MINOR.PATCH of the installed distribution; "0.0.0" if there is none."""
    # The parser of e-mail comes with it, which most commands of robotctl would import for nothing.
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415

    for distribution in _DISTRIBUTIONS:
        with suppress(PackageNotFoundError):
            return version(distribution)
    return "0.0.0"


def project_revision(repository: Path = Path(__file__).parents[1] / ".git") -> str:
    """Returns the git commit as 40 hexadecimal digits, or "" if unknown.

    The environment variable takes precedence over the checked-out commit of `repository`.
    """
    revision = os.environ.get(REVISION_VARIABLE, "").strip().lower() or _head_commit(repository)
    return revision if _REVISION.fullmatch(revision) else ""


def _head_commit(repository: Path) -> str:
    """Resolves HEAD as in gitrepository-layout(5): from files, because git is not installed on a robot."""
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
