"""Looks at the graph for the doctor."""

import time
from collections.abc import Callable, Sequence
from typing import Any, Final

from common.ros_node import OWN_NODES
from drive.config import DriveSettings
from drive.doctor.facts import GraphFacts, Rank, TopicFacts
from drive.doctor.parameters import Parameters, parameters_by
from drive.doctor.ranking import INPUTS, LOCKS, ranks_in, wanted
from drive.motion.values import ZERO
from drive.ros.subscriptions import newest, subscribe, velocity_of

DISCOVERY_S: Final = 3.0
_LISTEN_S: Final = 1.0
_POLL_S: Final = 0.02
_TIMEOUTS: Final = ("reference_timeout", "cmd_vel_timeout")
"""Of the mecanum and the differential drive controllers of ros2_controllers, in seconds; 0 is none."""


def look(node: Any, settings: DriveSettings) -> GraphFacts:
    """Returns what the graph shows, after discovery and a second of listening at the base."""
    mux_output = settings.mux_output
    listening = subscribe(node, mux_output.type, mux_output.topic) if mux_output else None
    time.sleep(DISCOVERY_S - _LISTEN_S)  # Polled as well, a missing node would take all of it.
    motions = 0

    def listen() -> bool:
        nonlocal motions
        message = newest(listening)
        motions += message is not None and velocity_of(message) != ZERO
        return False

    _poll(listen, _LISTEN_S)
    if listening:
        node.destroy_subscription(listening)  # An executor spins the node below.
    reaching = _topic(node, mux_output.topic, mux_output.type) if mux_output else None
    outputs = [_topic(node, output.topic, output.type) for output in settings.outputs]
    with parameters_by(node) as parameters:
        timeouts = _timeouts(parameters, reaching.subscribers) if reaching else {}
        ranks = _ranks(parameters, outputs)
    return GraphFacts(
        outputs=outputs,
        mux_output=reaching,
        lock=_topic(node, settings.lock_topic, "std_msgs/msg/Bool") if settings.lock_topic else None,
        stops=[_topic(node, topic, "std_msgs/msg/Bool") for topic in settings.stop_topics],
        odometry=_topic(node, settings.odometry, "nav_msgs/msg/Odometry") if settings.odometry else None,
        timeouts=timeouts | _configured(settings),
        foreign_motion=motions,
        ranks=ranks,
    )


def _poll(done: Callable[[], bool], for_s: float) -> bool:
    """Calls `done` until it returns true or time is up; returns which. Nothing here is spun."""
    end_s = time.monotonic() + for_s
    while time.monotonic() < end_s:
        if done():
            return True
        time.sleep(_POLL_S)
    return False


def _topic(node: Any, name: str, type_name: str) -> TopicFacts:
    publishers = _foreign(node.get_publishers_info_by_topic(name))
    subscribers = _foreign(node.get_subscriptions_info_by_topic(name))
    return TopicFacts(
        name,
        type_name,
        publishers=tuple(dict.fromkeys(map(_full_name, publishers))),
        subscribers=tuple(dict.fromkeys(map(_full_name, subscribers))),
        types=frozenset(each.topic_type for each in (*publishers, *subscribers)),
    )


def _full_name(endpoint: Any) -> str:
    return f"{endpoint.node_namespace}/{endpoint.node_name}".lstrip("/")


def _foreign(found: list[Any]) -> list[Any]:
    return [each for each in found if each.node_name not in OWN_NODES]


def _configured(settings: DriveSettings) -> dict[str, float]:
    timeout_ms = settings.base_timeout_ms
    return {"configured: base_timeout_ms": timeout_ms / 1000} if timeout_ms is not None else {}


def _timeouts(parameters: Parameters, names: tuple[str, ...]) -> dict[str, float]:
    """Asks the base's nodes for the parameters that name a timeout."""
    # One by one: a node that does not know one of several names says nothing at all.
    found = {
        f"{name}: {parameter}": parameters.values(name, [parameter]).get(parameter)
        for name in names
        for parameter in _TIMEOUTS
    }
    return {name: value for name, value in found.items() if isinstance(value, float)}


def _ranks(parameters: Parameters, inputs: Sequence[TopicFacts]) -> tuple[Rank, ...]:
    """Asks the nodes that take our velocities how they rank them; the multiplexer is the one that does."""
    for name in dict.fromkeys(name for each in inputs for name in each.subscribers):
        names = wanted(parameters.names(name, [INPUTS, LOCKS]))
        namespace = name.rpartition("/")[0]
        if names and (ranks := ranks_in(parameters.values(name, names), namespace)):
            return ranks
    return ()
