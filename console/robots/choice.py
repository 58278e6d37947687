"""Which robot is meant, when a command line, the environment and a file may all say so."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

from console.client import DEFAULT_TARGET
from console.robots.book import Robot, RobotBook, read_book

TARGET_VARIABLE: Final = "ROBOTCTL_TARGET"
ROBOT_VARIABLE: Final = "ROBOTCTL_ROBOT"


@dataclass(frozen=True, slots=True)
class Choice:
    """The robot that is meant.

    Args:
        robot: how it is reached.
        name: as the file calls it; None when only an address was given.
    """

    robot: Robot
    name: str | None = None


def choose(
    target: str | None,
    name: str | None,
    environment: Mapping[str, str],
    read: Callable[[], RobotBook] = read_book,
) -> Choice:
    """Whoever speaks first: --target, --robot, the environment (address, then name), the default, localhost.

    An address typed beside a name stands in for the address alone: what proves who asks stays the named
    robot's, as needed behind a tunnel. An address on its own goes with nothing from the file, which then is
    not even read.

    Args:
        target: what --target says.
        name: what --robot says.
        environment: the process's.
        read: reads the file.

    Raises:
        UserError: no robot has this name, or the file is wrong.
    """
    if name:
        robot = read().find(name)
        return Choice(replace(robot, target=target) if target else robot, name)
    if address := target or environment.get(TARGET_VARIABLE):
        return Choice(Robot(target=address))
    book = read()
    if chosen := environment.get(ROBOT_VARIABLE) or book.default:
        return Choice(book.find(chosen), chosen)
    return Choice(Robot(target=DEFAULT_TARGET))
