"""What the environment tells ROS 2, checked before ROS 2 reads it: its own answer is to end the process."""

import ctypes
import os
from typing import Final

from common.errors import ExitCode, UserError

# Beyond it, the ports that DDS computes from the domain do not exist, and Fast DDS ends the process.
_LAST_DOMAIN: Final = 232


def check_domain() -> None:
    """Refuses a domain that can't be.

    Raises:
        UserError: ROS_DOMAIN_ID is no number of a domain.
    """
    domain = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not (domain.isascii() and domain.isdigit() and int(domain) <= _LAST_DOMAIN):
        raise UserError(
            f"ROS_DOMAIN_ID is '{domain}'",
            f"Set it to a number from 0 to {_LAST_DOMAIN}",
            exit_code=ExitCode.USAGE,
        )


def check_middleware() -> None:
    """Refuses a middleware that is not installed; to be called before anything imports rclpy.

    Raises:
        UserError: RMW_IMPLEMENTATION names none that can be loaded.
    """
    name = os.environ.get("RMW_IMPLEMENTATION", "")
    if not name:
        return
    try:
        ctypes.CDLL(f"lib{name}.so")
    except OSError as error:
        raise UserError(
            f"RMW_IMPLEMENTATION is '{name}', which can't be loaded here",
            f"Unset it, or type: apt install ros-$ROS_DISTRO-{name.replace('_', '-')}",
            exit_code=ExitCode.USAGE,
        ) from error
