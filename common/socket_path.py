"""Paths of Unix sockets in a configuration: what Linux takes. Pure."""

from pathlib import Path
from typing import Annotated, Final

from pydantic import AfterValidator

MAX_SOCKET_PATH: Final = 107
"""Longest path of a Unix socket in bytes: Linux's sun_path holds 108, with the final NUL (unix(7))."""


def _takes(path: Path) -> Path:
    if not path.name or "\0" in str(path):
        raise ValueError("the path of a socket, /run/robot/it.sock for example")
    if len(bytes(path)) > MAX_SOCKET_PATH:
        raise ValueError(f"a path of at most {MAX_SOCKET_PATH} bytes; this one has {len(bytes(path))}")
    return path


SocketPath = Annotated[Path, AfterValidator(_takes)]
"""The path of a Unix socket, of this program's or of one that it connects to."""
