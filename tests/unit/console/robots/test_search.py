"""A search of the network beside a list: in its own thread, from the opening of the list to its end."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest

from common.errors import UserError
from console.robots.roster import RobotChoice
from console.robots.search import NetworkSearch
from tests.support.waiting import wait_until


@dataclass(frozen=True)
class Found:
    name: str
    target: str
    tls: bool = False
    login_command: str = "robotctl login lab FILE"


@dataclass
class Network:
    """What is announced on it, and the searches that are open."""

    robots: list[Found] = field(default_factory=list)
    open: int = 0
    opened_in: set[str] = field(default_factory=set)
    error: UserError | None = None
    blocked: threading.Event | None = None

    @contextmanager
    def search(self) -> Iterator["Network"]:
        self.opened_in.add(threading.current_thread().name)
        if self.blocked:
            self.blocked.wait(10)
        if self.error:
            raise self.error
        self.open += 1
        try:
            yield self
        finally:
            self.open -= 1


@pytest.fixture
def network() -> Iterator[Network]:
    made = Network()
    yield made
    wait_until(lambda: "robot-search" not in {each.name for each in threading.enumerate()}, "all have ended")
    assert made.open == 0


@pytest.fixture
def search(network: Network) -> Iterator[NetworkSearch]:
    made = NetworkSearch(network.search)  # type: ignore[arg-type]
    yield made
    made.end()


def test_what_is_found_is_handed_over_and_stays_readable(network: Network, search: NetworkSearch) -> None:
    changes: list[int] = []
    search.begin(lambda: changes.append(1))
    was_open = search.is_open
    assert was_open
    network.robots.append(Found("lab", "10.0.0.1:1"))
    wait_until(lambda: search.robots == (RobotChoice("lab", "10.0.0.1:1", known=False),), "it is found")
    wait_until(lambda: changes == [1], "the change")
    network.robots.append(Found("safe", "10.0.0.2:1", tls=True))
    wait_until(lambda: len(search.robots) == 2, "the next one")
    assert search.robots[1].login_command == "robotctl login lab FILE"
    search.end()
    assert not search.is_open
    wait_until(lambda: network.open == 0, "the search has ended")
    assert len(search.robots) == 2
    assert network.opened_in == {"robot-search"}


def test_a_list_that_is_opened_again_begins_anew(network: Network, search: NetworkSearch) -> None:
    network.robots.append(Found("lab", "10.0.0.1:1"))
    search.begin(lambda: None)
    wait_until(lambda: search.robots, "it is found")
    network.robots.clear()
    search.begin(lambda: None)
    assert search.robots == ()
    wait_until(lambda: network.open == 1, "one search at a time is left")


def test_a_network_that_cannot_be_searched_is_said(network: Network, search: NetworkSearch) -> None:
    network.error = UserError("this computer can't search its networks", "Name the robot's address")
    changed = threading.Event()
    search.begin(changed.set)
    assert changed.wait(10)
    assert search.error is network.error


def test_a_search_that_opens_slowly_delays_no_caller(network: Network, search: NetworkSearch) -> None:
    """The list that asked for it may be closed by then: what it finds is of no use any more."""
    network.blocked = threading.Event()
    network.robots.append(Found("late", "10.0.0.9:1"))
    search.begin(pytest.fail)
    search.end()
    network.blocked.set()
    wait_until(lambda: "robot-search" not in {each.name for each in threading.enumerate()}, "it has ended")
    assert search.robots == ()
