"""What takes the velocities, in a graph that the test makes up."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from drive.motion.values import MS
from drive.ros.takers import Takers

OUTPUT, BEHIND = "/cmd_vel", "/reference"
NOTHING = f"nothing takes the velocities on {OUTPUT}"
NO_BASE = f"no base takes the velocities on {BEHIND}"


@dataclass
class Graph:
    """A node of rclpy, and the publisher: who subscribes as the graph lists it, and how many are matched."""

    names: dict[str, list[str]] = field(default_factory=lambda: {OUTPUT: ["mux"], BEHIND: ["base"]})
    taking: int = 1
    unreadable: bool = False
    now_ms: int = 1000
    counted: int = 0

    def __post_init__(self) -> None:
        self.takers = Takers(self, self, [OUTPUT], BEHIND, {"recorder"})

    def matched(self) -> int:
        return self.taking

    def count_subscribers(self, topic: str) -> int:
        self.counted += 1
        return len(self.names[topic])

    def get_subscriptions_info_by_topic(self, topic: str) -> list[Any]:
        if self.unreadable:
            raise UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte")
        return [SimpleNamespace(node_name=name) for name in self.names[topic]]

    def problems(self, after_ms: int = 20) -> list[str]:
        self.now_ms += after_ms
        return self.takers.problems(self.now_ms * MS)


@pytest.fixture
def graph() -> Graph:
    return Graph()


def test_multiplexer_and_base_are_enough(graph: Graph) -> None:
    assert graph.problems() == []


def test_observers_are_no_base(graph: Graph) -> None:
    graph.names = {OUTPUT: ["recorder"], BEHIND: ["recorder"]}
    assert graph.problems() == [NOTHING, NO_BASE]


def test_an_observer_that_is_listed_before_it_is_matched_changes_nothing(graph: Graph) -> None:
    """The defect: the observers of the list were taken off the number of the matched."""
    assert graph.problems() == []
    graph.names = {OUTPUT: ["mux", "recorder"], BEHIND: ["base", "recorder"]}
    for _ in range(100):
        assert graph.problems() == []


def test_a_base_that_is_listed_before_it_is_matched_takes_nothing(graph: Graph) -> None:
    """The defect: a recorder that was matched earlier counted in its place."""
    graph.names[OUTPUT] = ["recorder", "mux"]
    assert graph.problems() == [NOTHING]
    graph.taking = 2
    assert graph.problems() == []


def test_an_observer_that_leaves_changes_nothing(graph: Graph) -> None:
    graph.names[OUTPUT], graph.taking = ["recorder", "mux"], 2
    assert graph.problems() == []
    graph.taking = 1
    assert graph.problems() == [], "it is still listed"
    graph.names[OUTPUT] = ["mux"]
    for _ in range(100):
        assert graph.problems() == []


def test_what_is_listed_and_not_matched_takes_nothing(graph: Graph) -> None:
    graph.taking = 0
    assert graph.problems() == [NOTHING]


def test_a_multiplexer_that_goes_is_missed_at_once_and_a_base_within_100_ms(graph: Graph) -> None:
    assert graph.problems() == []
    graph.names[BEHIND] = []
    assert graph.problems() == [], "it counts for a moment longer"
    assert graph.problems(after_ms=80) == [NO_BASE]
    graph.taking, graph.names[OUTPUT] = 0, []
    assert graph.problems() == [NOTHING, NO_BASE]


def test_the_graph_is_asked_for_the_number_ten_times_a_second(graph: Graph) -> None:
    for _ in range(50):
        graph.problems()
    assert graph.counted == 10


def test_where_names_cant_be_read_the_numbers_count(graph: Graph) -> None:
    graph.unreadable = True
    assert graph.problems() == []
    graph.taking = 0
    assert graph.problems() == [NOTHING]
