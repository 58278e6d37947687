"""A search of the network that has found what the test says."""

from collections.abc import Callable, Sequence

from common.errors import UserError
from console.robots.roster import RobotChoice


class FoundRobots:
    """Finds nothing more.

    Args:
        robots: have been found.
    """

    is_open = False
    error: UserError | None = None

    def __init__(self, robots: Sequence[RobotChoice]) -> None:
        self.robots = robots

    def begin(self, on_change: Callable[[], None]) -> None:
        pass

    def end(self) -> None:
        pass
