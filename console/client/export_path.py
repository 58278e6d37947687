"""Where a file of a robot may be written: below the chosen folder, whatever the robot calls it."""

import re
from pathlib import Path
from typing import Final

from console.client.errors import GatewayFailed

_FORBIDDEN: Final = frozenset('\\:*?"<>|')
"""What file systems, drives and streams give a meaning to, on this system or another."""
_MOST_BYTES: Final = 250
"""Of a name, so that it and ".part" fit into the 255 that file systems have."""
_MOST_PARTS: Final = 16
_DEVICES: Final = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
"""Names that are devices on Windows, with any extension (Win32, "Naming Files, Paths, and Namespaces")."""


def path_below(folder: Path, name: str) -> Path:
    """Returns the path of a robot's file.

    Args:
        folder: Where the recording is written.
        name: Of the file, as the robot says.

    Raises:
        GatewayFailed: The file would not be below the folder, or its name is not portable.
    """
    parts = name.split("/")
    if len(parts) > _MOST_PARTS or not all(map(_is_usable, parts)):
        raise GatewayFailed(f"the robot has a file with an unusable name, {name[:80]!r}", "It is not written")
    path = folder.joinpath(*parts)
    # A symbolic link in the folder may lead elsewhere.
    if not path.parent.resolve().is_relative_to(folder.resolve()):
        raise GatewayFailed(f"{path.parent} leads out of {folder}", "Choose another folder")
    return path


def _is_usable(part: str) -> bool:
    return (
        0 < len(part.encode()) <= _MOST_BYTES
        and part.isprintable()
        and not _FORBIDDEN.intersection(part)
        and not _DEVICES.fullmatch(part)
        and part[0] not in "~-"
        and part[-1] not in ". "  # "." and ".." as well
    )
