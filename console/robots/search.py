"""Searches the networks for robots while a list of them is open, without keeping the list waiting."""

import os
import threading
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Final, Protocol, TypeAlias

from common.errors import UserError
from console.robots.roster import RobotChoice

if TYPE_CHECKING:
    from console.robots.discovery import DiscoveredRobot

_LOOK_EVERY_S: Final = 0.2


class OpenSearch(Protocol):
    """The part of `console.robots.discovery.Discovery` that is used here."""

    @property
    def robots(self) -> "Iterable[DiscoveredRobot]":
        """What was found so far."""


Open: TypeAlias = Callable[[], AbstractContextManager[OpenSearch]]


class NetworkSearch:
    """A search for robots that announce themselves. Each has a thread of its own, as it may block.

    Args:
        open_search: opens a search, in its thread; by default on the networks of $ROBOTCTL_DISCOVERY.
    """

    def __init__(self, open_search: Open | None = None) -> None:
        self._open = open_search or _on_networks
        self._ending: threading.Event | None = None
        """Of the search that is open."""
        self._lock = threading.Lock()
        self._robots: tuple[RobotChoice, ...] = ()
        self._error: UserError | None = None

    @property
    def robots(self) -> tuple[RobotChoice, ...]:
        """What the newest search has found so far. All of it is hearsay."""
        with self._lock:
            return self._robots

    @property
    def error(self) -> UserError | None:
        """Why nothing can be found; None while that is not known."""
        with self._lock:
            return self._error

    @property
    def is_open(self) -> bool:
        """Whether a search goes on."""
        return self._ending is not None

    def begin(self, on_change: Callable[[], None]) -> None:
        """Begins anew.

        Args:
            on_change: called after each change, in the search's thread; must only hand over.
        """
        self.end()
        ending = self._ending = threading.Event()
        with self._lock:
            self._robots, self._error = (), None
        threading.Thread(target=self._run, args=(ending, on_change), name="robot-search", daemon=True).start()

    def end(self) -> None:
        """Ends the search, if there is one; what it has found stays readable. Never waits."""
        if self._ending:
            self._ending.set()
            self._ending = None

    def _run(self, ending: threading.Event, on_change: Callable[[], None]) -> None:
        try:
            with self._open() as search:
                while not ending.wait(_LOOK_EVERY_S):
                    found = tuple(_choice(each) for each in search.robots)
                    if found != self.robots and self._keep(ending, found, None):
                        on_change()
        except UserError as error:
            if self._keep(ending, (), error):
                on_change()

    def _keep(
        self, ending: threading.Event, robots: tuple[RobotChoice, ...], error: UserError | None
    ) -> bool:
        """Keeps what was found, unless another search has begun meanwhile."""
        with self._lock:
            if ending.is_set():
                return False
            self._robots, self._error = robots, error
            return True


def _on_networks() -> AbstractContextManager[OpenSearch]:
    # Late: its library takes long to import.
    from console.robots import discovery  # noqa: PLC0415

    return discovery.Discovery(discovery.addresses_in(os.environ))


def _choice(found: "DiscoveredRobot") -> RobotChoice:
    login = found.login_command if found.tls else ""
    return RobotChoice(found.name, found.target, known=False, login_command=login)
