"""Which topics are named as other sources of commands, while the graph is being discovered."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, Final

import pytest

from drive.motion.values import DISCOVERY_NS, MS
from drive.ros.other_sources import OtherSources

pytestmark = pytest.mark.ros

OUTPUT, MUX_OUTPUT = "/cmd_vel_gateway", "/cmd_vel"
TYPE: Final = "geometry_msgs/msg/TwistStamped"
RECORDER, MUX = "rosbag2_recorder", "twist_mux"
INPUTS: Final = {RECORDER: (OUTPUT, "/wheels/velocity"), MUX: (OUTPUT, "/cmd_vel_keyboard")}


@dataclass
class Graph:
    """As far as a node shows it; a recorder that takes everything is discovered first."""

    nodes: set[str] = field(default_factory=lambda: {RECORDER})
    inputs: dict[str, tuple[str, ...]] = field(default_factory=lambda: dict(INPUTS))

    def get_subscriptions_info_by_topic(self, topic: str) -> list[Any]:
        return [endpoint(name) for name in self.nodes if topic in self.inputs[name]]

    def get_publishers_info_by_topic(self, topic: str) -> list[Any]:
        return [endpoint(name) for name in self.nodes if (name, topic) == (MUX, MUX_OUTPUT)]

    def get_subscriber_names_and_types_by_node(self, name: str, _namespace: str) -> list[Any]:
        return [(topic, [TYPE]) for topic in self.inputs[name]]

    def destroy_subscription(self, _subscription: Any) -> None:
        pass


def endpoint(name: str) -> Any:
    return SimpleNamespace(node_name=name, node_namespace="/")


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> Graph:
    """Its messages are none: what is new counts as motion for a while."""
    monkeypatch.setattr("drive.ros.other_sources.subscribe", lambda *_: None)
    monkeypatch.setattr("drive.ros.other_sources.newest", lambda _: None)
    monkeypatch.setattr("drive.ros.other_sources.time.monotonic_ns", lambda: 0)
    return Graph()


def named(sources: OtherSources, until_ns: int, since_ns: int = 500 * MS) -> set[str]:
    """What is named, asked every 100 ms."""
    return {topic for now_ns in range(since_ns, until_ns, 100 * MS) for topic in sources.commanding(now_ns)}


def test_what_an_observer_takes_is_not_named_while_the_multiplexer_is_discovered(graph: Graph) -> None:
    sources = OtherSources(graph, [OUTPUT], MUX_OUTPUT)
    assert named(sources, 1_500 * MS) == set()
    graph.nodes.add(MUX)
    assert named(sources, DISCOVERY_NS + 2_000 * MS, 1_500 * MS) == {"/cmd_vel_keyboard"}


def test_where_no_multiplexer_is_discovered_all_that_take_velocities_count(graph: Graph) -> None:
    sources = OtherSources(graph, [OUTPUT], MUX_OUTPUT)
    assert named(sources, DISCOVERY_NS) == set()
    assert not sources.known(DISCOVERY_NS - 1, 0)
    sources = OtherSources(graph, [OUTPUT], MUX_OUTPUT)
    assert named(sources, DISCOVERY_NS + 900 * MS, DISCOVERY_NS) == {"/wheels/velocity"}


def test_a_multiplexer_that_is_known_is_believed_at_once(graph: Graph) -> None:
    graph.nodes.add(MUX)
    assert named(OtherSources(graph, [OUTPUT], MUX_OUTPUT), 900 * MS) == {"/cmd_vel_keyboard"}


def test_a_multiplexer_that_is_started_again_has_the_inputs_that_it_had(graph: Graph) -> None:
    """Though the observer alone takes the velocities meanwhile, and counts as well."""
    graph.nodes.add(MUX)
    sources = OtherSources(graph, [OUTPUT], MUX_OUTPUT)
    assert named(sources, DISCOVERY_NS) == {"/cmd_vel_keyboard"}
    graph.nodes.remove(MUX)
    named(sources, 2 * DISCOVERY_NS, DISCOVERY_NS)
    assert set(sources._inputs) == {"/cmd_vel_keyboard", "/wheels/velocity"}
    graph.nodes.add(MUX)
    named(sources, 3 * DISCOVERY_NS, 2 * DISCOVERY_NS)
    assert list(sources._inputs) == ["/cmd_vel_keyboard"]


def test_one_that_is_discovered_input_by_input_keeps_those_that_are_not_there_yet(graph: Graph) -> None:
    """The defect: a source that went on publishing to one of them was not heard until the next look."""
    graph.nodes.add(MUX)
    both = graph.inputs[MUX] = (*INPUTS[MUX], "/cmd_vel_autonomy")
    sources = OtherSources(graph, [OUTPUT], MUX_OUTPUT)
    named(sources, DISCOVERY_NS)
    assert set(sources._inputs) == {*both[1:]}
    graph.inputs[MUX] = INPUTS[MUX]
    named(sources, DISCOVERY_NS + 500 * MS, DISCOVERY_NS)
    assert set(sources._inputs) == {*both[1:]}
    graph.inputs[MUX] = both
    named(sources, DISCOVERY_NS + 1_000 * MS, DISCOVERY_NS + 500 * MS)
    assert set(sources._inputs) == {*both[1:]}
    graph.inputs[MUX] = INPUTS[MUX]
    named(sources, DISCOVERY_NS + 2_500 * MS, DISCOVERY_NS + 1_000 * MS)
    assert set(sources._inputs) == {"/cmd_vel_keyboard"}, "it does not take the other any more"


@pytest.mark.parametrize("beside", [set(), {RECORDER}], ids=["alone", "beside a recorder"])
def test_one_that_was_half_discovered_as_it_went_keeps_its_inputs(graph: Graph, beside: set[str]) -> None:
    """Its shutdown and its return are two different times at which an input is missing."""
    graph.nodes = {MUX, *beside}
    both = graph.inputs[MUX] = (*INPUTS[MUX], "/cmd_vel_autonomy")
    sources = OtherSources(graph, [OUTPUT], MUX_OUTPUT)
    named(sources, DISCOVERY_NS)
    graph.inputs[MUX] = INPUTS[MUX]
    named(sources, DISCOVERY_NS + 500 * MS, DISCOVERY_NS)
    graph.nodes = beside
    named(sources, 2 * DISCOVERY_NS, DISCOVERY_NS + 500 * MS)
    graph.nodes = {MUX, *beside}
    named(sources, 2 * DISCOVERY_NS + 500 * MS, 2 * DISCOVERY_NS)
    assert {*both[1:]} <= set(sources._inputs)


def test_what_an_observer_takes_leaves_room_as_soon_as_the_multiplexer_is_back(graph: Graph) -> None:
    """It has an input now that it did not have before."""
    graph.inputs[RECORDER] = (OUTPUT, *(f"/observed_{number}" for number in range(30)))
    graph.nodes.add(MUX)
    sources = OtherSources(graph, [OUTPUT], MUX_OUTPUT)
    named(sources, DISCOVERY_NS)
    graph.nodes.remove(MUX)
    named(sources, 2 * DISCOVERY_NS, DISCOVERY_NS)
    assert len(sources._inputs) == 16
    graph.nodes.add(MUX)
    graph.inputs[MUX] = (*INPUTS[MUX], "/cmd_vel_autonomy")
    named(sources, 2 * DISCOVERY_NS + 200 * MS, 2 * DISCOVERY_NS)
    assert {"/cmd_vel_keyboard", "/cmd_vel_autonomy"} <= set(sources._inputs)


def test_the_multiplexers_inputs_are_listened_to_before_the_others_are_left(graph: Graph) -> None:
    """The defect: not before all that an observer takes had been left, one every 100 ms."""
    graph.inputs[RECORDER] = (OUTPUT, *(f"/observed_{number}" for number in range(15)))
    sources = OtherSources(graph, [OUTPUT], MUX_OUTPUT)
    named(sources, 2_000 * MS)
    assert len(sources._inputs) == 15
    graph.nodes.add(MUX)
    named(sources, 2_100 * MS, 2_000 * MS)
    assert "/cmd_vel_keyboard" in sources._inputs
    named(sources, 4_000 * MS, 2_100 * MS)
    assert list(sources._inputs) == ["/cmd_vel_keyboard"]


def test_where_as_many_are_listened_to_as_may_be_one_makes_room_for_an_input(graph: Graph) -> None:
    graph.inputs[RECORDER] = (OUTPUT, *(f"/observed_{number}" for number in range(30)))
    sources = OtherSources(graph, [OUTPUT], MUX_OUTPUT)
    named(sources, 2_500 * MS)
    assert len(sources._inputs) == 16
    graph.nodes.add(MUX)
    named(sources, 2_700 * MS, 2_500 * MS)
    assert "/cmd_vel_keyboard" in sources._inputs
