"""The command that starts one of the robot's programs, as the user has to type it on this machine."""

import os
from typing import Final

_VARIABLE: Final = "ROBOT_GATEWAY_START"
"""Set where a supervisor starts the programs, to its command, "sudo systemctl restart" for example."""


def start_command(program: str) -> str:
    """Returns the complete command line.

    Args:
        program: its name, "robot-preview" for example.
    """
    supervisor = os.environ.get(_VARIABLE)
    return f"{supervisor} {program}" if supervisor else f"{program} serve"
