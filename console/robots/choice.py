"""Which robot a command is for: from its options, the environment and the file of known robots."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from common.errors import ExitCode, UserError
from console.robots.robots_file import Robot, RobotsFile, read_robots_file
from console.target import DEFAULT_TARGET

TARGET_VARIABLE: Final = "ROBOTCTL_TARGET"
ROBOT_VARIABLE: Final = "ROBOTCTL_ROBOT"


class NotChosenError(UserError):
    """Robots are known, and nothing says which one is meant."""


def choose(
    target: str | None,
    name: str | None,
    environment: Mapping[str, str],
    read: Callable[[], RobotsFile] = read_robots_file,
) -> tuple[Robot, str | None]:
    """Returns the robot of --target, --robot, the environment (address, then name), the file, or localhost.

    The first of these decides, localhost only where no robot is known. An address beside a name replaces the
    address alone: the credentials stay those of the named robot, as needed behind a tunnel. An address on its
    own uses nothing from the file, which then is not even read.

    Args:
        target: Value of --target.
        name: Value of --robot.
        environment: Environment of the process.
        read: Reads the file.

    Raises:
        NotChosenError: The file has robots but no default.
        UserError: No robot has this name, or the file is wrong.
    """
    if name:
        robot = read().find(name)
        return (replace(robot, target=target) if target else robot), name
    if address := target or environment.get(TARGET_VARIABLE):
        return Robot(target=address), None
    known = read()
    if chosen := environment.get(ROBOT_VARIABLE) or known.default:
        return known.find(chosen), chosen
    if known.robots:
        # Localhost would be another robot than any of these.
        raise NotChosenError(
            f"no robot is chosen, and none of {', '.join(known.robots)} is the default",
            "Name one of them, or type: robotctl robots default NAME",
            exit_code=ExitCode.USAGE,
        )
    return Robot(target=DEFAULT_TARGET), None
