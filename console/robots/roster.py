"""The robots that an operator may switch to: the known ones, and those found on the network."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from common.errors import UserError
from console.robots.robots_file import RobotsFile, read_robots_file


@dataclass(frozen=True, slots=True)
class RobotChoice:
    """One robot to switch to.

    Args:
        name: as the file of known robots has it, or as the robot advertises itself.
        target: HOST:PORT of its gateway.
        known: whether it is in the file: only then it has a login.
    """

    name: str
    target: str
    known: bool


Discover: TypeAlias = Callable[[], Sequence[RobotChoice]]
"""Returns the robots found so far, at once."""


class Roster:
    """Lists robots anew at each call.

    Args:
        read: reads the file of known robots.
        discovered: returns the robots found on the network; by default none.
    """

    def __init__(
        self, read: Callable[[], RobotsFile] = read_robots_file, discovered: Discover = lambda: ()
    ) -> None:
        self._read = read
        self._discovered = discovered
        self.error: UserError | None = None
        """Why the known robots can't be listed; None while they can."""

    def choices(self) -> list[RobotChoice]:
        """Returns the known robots, in the file's order, then the discovered ones that are not among them."""
        try:
            robots, self.error = self._read().robots, None
        except UserError as error:
            robots, self.error = {}, error
        known = [RobotChoice(name, robot.target, known=True) for name, robot in robots.items()]
        targets = {choice.target for choice in known}
        return known + [found for found in self._discovered() if found.target not in targets]
