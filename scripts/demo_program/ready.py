"""When each program is up."""

import socket
from typing import Final

from common.errors import UserError
from console.client import GatewayClient, GatewayError, SystemStatus
from demo_program.ground import Ground
from demo_program.programs import Programs
from simrobot.control import ask

START_WITHIN_S: Final = 30.0


def wait_until_up(ground: Ground, programs: Programs, robot: GatewayClient) -> None:
    """Returns when all answer, and the gateway has met the preview service and the drive program."""
    programs.wait_until(lambda: _robot_answers(ground), START_WITHIN_S, "the simulated robot answers")
    programs.wait_until(lambda: _preview_listens(ground), START_WITHIN_S, "the preview service listens")
    programs.wait_until(lambda: _met(robot), START_WITHIN_S, "the gateway answers and has met the others")


def status_or_none(robot: GatewayClient) -> SystemStatus | None:
    """The status, or None while the gateway does not answer."""
    try:
        return robot.status()
    except GatewayError:
        return None


def _robot_answers(ground: Ground) -> bool | None:
    try:
        ask(ground.control_socket, {})
    except UserError:
        return None
    return True


def _preview_listens(ground: Ground) -> bool | None:
    with socket.socket(socket.AF_UNIX) as probe:
        try:
            probe.connect(str(ground.preview_socket))
        except OSError:
            return None
    return True


def _met(robot: GatewayClient) -> bool | None:
    status = status_or_none(robot)
    met = status and status.preview.service_reachable and status.teleop.enabled
    return True if met else None
