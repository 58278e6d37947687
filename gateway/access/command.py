"""The command that manages credentials, as the user has to type it on this machine."""

import os
import shlex
from pathlib import Path
from typing import Final

_VARIABLE: Final = "ROBOT_GATEWAY_CREDENTIALS"
"""Set in containers to the command that runs there in place of `robot-gateway credentials`."""


def credentials_command(arguments: str, directory: Path | None = None, config: Path | None = None) -> str:
    """Returns the complete command line.

    Args:
        arguments: of `robot-gateway credentials`, "init" for example.
        directory: of the credentials; a command in a container has its own.
        config: file of the gateway's configuration, as it was given.
    """
    if in_container := os.environ.get(_VARIABLE):
        return f"{in_container} {arguments}"
    given = {"--config": config, "--directory": directory}
    options = "".join(f" {option} {shlex.quote(str(path))}" for option, path in given.items() if path)
    return f"robot-gateway credentials {arguments}{options}"
