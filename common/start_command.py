"""The commands that start one of the robot's programs, or give it messages, as typed on this machine."""

import os
from pathlib import Path
from typing import Final

_VARIABLE: Final = "ROBOT_GATEWAY_START"
"""Set where a supervisor starts the programs, to its command, "sudo systemctl restart" for example."""
_OF_IMAGE: Final = Path("/usr/share/robot-gateway-packages.txt")
"""Which the images have, and no other installation."""


def start_command(program: str) -> str:
    """Returns the complete command line.

    Args:
        program: its name, "robot-preview" for example.
    """
    supervisor = os.environ.get(_VARIABLE)
    return f"{supervisor} {program}" if supervisor else f"{program} serve"


def is_supervised() -> bool:
    """Returns whether units of systemd start the programs on this machine."""
    return bool(os.environ.get(_VARIABLE))


def messages_remedy() -> str:
    """Returns what gives the gateway the message packages of the robot's own nodes, in their version."""
    if _OF_IMAGE.exists():
        return (
            "In the directory of compose.yaml, type: scripts/images build --ros packages "
            "&& docker compose up -d gateway (YOLO_ROS_COMMIT in .env chooses the version of yolo_msgs)"
        )
    workspace = "the workspace that the robot's own nodes use"
    if is_supervised():
        return (
            "Type: sudo scripts/install-robot --ros-setup /opt/robot-workspace/setup.bash "
            f"&& {start_command('robot-gateway')} (with the setup.bash of {workspace})"
        )
    return f"Source the setup.bash of {workspace}, and type: {start_command('robot-gateway')}"
