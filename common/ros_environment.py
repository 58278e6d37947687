"""Validates the environment variables of ROS 2, because ROS 2 itself aborts the process on invalid ones."""

import ctypes
import os
from typing import Final

from common.errors import ExitCode, UserError

_LAST_DOMAIN: Final = 232
"""The ports of higher domains exceed 65535 (DDSI-RTPS 9.6: 7400 + 250 x domain); Fast DDS then aborts."""


def check_domain() -> None:
    """Validates ROS_DOMAIN_ID.

    Raises:
        UserError: it is not a number from 0 to 232.
    """
    domain = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not (domain.isascii() and domain.isdigit() and int(domain) <= _LAST_DOMAIN):
        raise UserError(
            f"ROS_DOMAIN_ID is '{domain}'",
            f"Set it to a number from 0 to {_LAST_DOMAIN}",
            exit_code=ExitCode.USAGE,
        )


def check_middleware() -> None:
    """Validates RMW_IMPLEMENTATION; must be called before rclpy is imported.

    Raises:
        UserError: it names a middleware that can't be loaded.
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
