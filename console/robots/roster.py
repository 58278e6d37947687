"""The robots that an operator may switch to: the known ones, and those found on the network."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from common.errors import UserError
from console.robots.robots_file import RobotsFile, read_robots_file


@dataclass(frozen=True, slots=True)
class RobotChoice:
    """One robot to switch to.

    Args:
        name: as the file of known robots has it, or as the robot advertises itself.
        target: HOST:PORT of its gateway.
        known: whether it is in the file: only then it has a login.
        login_command: stores a login for one that says that it requires one; empty for others.
    """

    name: str
    target: str
    known: bool
    login_command: str = ""


class Search(Protocol):
    """Searches the network while a list is open. No method waits."""

    @property
    def robots(self) -> Sequence[RobotChoice]:
        """What was found so far."""

    @property
    def error(self) -> UserError | None:
        """Why nothing can be found; None while that is not known."""

    @property
    def is_open(self) -> bool:
        """Whether the search goes on."""

    def begin(self, on_change: Callable[[], None]) -> None:
        """Begins anew; calls `on_change` after each change, in any thread."""

    def end(self) -> None:
        """Ends it."""


class NoSearch:
    """Finds nothing."""

    robots: Sequence[RobotChoice] = ()
    error: UserError | None = None
    is_open = False

    def begin(self, on_change: Callable[[], None]) -> None:
        """Does nothing."""

    def end(self) -> None:
        """Does nothing."""


_NO_SEARCH: Final = NoSearch()


class Roster:
    """Lists robots anew at each call.

    Args:
        read: reads the file of known robots.
        search: finds robots on the network; by default none.
    """

    def __init__(
        self, read: Callable[[], RobotsFile] = read_robots_file, search: Search = _NO_SEARCH
    ) -> None:
        self._read = read
        self.search = search
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
        return known + [found for found in self.search.robots if found.target not in targets]
