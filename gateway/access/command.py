"""What a robot's keeper types here to change credentials: in containers it is another command."""

import os
from pathlib import Path
from typing import Final

_VARIABLE: Final = "ROBOT_GATEWAY_CREDENTIALS"
"""Whoever wraps the program names the wrapped command in it; it knows its directory."""


def to_type(words: str, directory: Path | None = None) -> str:
    """The whole command, for a person to type.

    Args:
        words: of `robot-gateway credentials`, "init" for example.
        directory: where the credentials are, if that has to be said.
    """
    if wrapped := os.environ.get(_VARIABLE):
        return f"{wrapped} {words}"
    where = f" --directory {directory}" if directory else ""
    return f"robot-gateway credentials {words}{where}"
