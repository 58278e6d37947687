"""One image topic: its subscription, which follows the publishers, and its newest message.

| in the graph | done |
|---|---|
| nothing publishes the topic | a problem; a subscription stays, for publishers that come back |
| it has another type | a problem that names the type |
| its type changes from one image type to the other, or its reliability | another subscription |
| it is published as both | the type that is subscribed; at first Image |
| a name in the graph that is not UTF-8 | what is subscribed goes on |
| the types of sensor_msgs are missing | a problem that names the package |

No executor spins. The thread that owns a camera waits in the middleware for its next message, so that no
frame waits for another; a queue of one message holds the newest.
"""

import threading
import time
from collections.abc import Collection, Sequence
from typing import Any, Final

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from common.ros_node import TypeMissingError, message_class, subscribe_raw
from tap.image import READERS

EXAMINE_EVERY_S: Final = 0.5
DISCOVERY_S: Final = 3.0
"""After its start a node knows of no publisher yet."""
_NS_PER_S: Final = 1_000_000_000


class Graph:
    """The tap's node, used by the threads of all cameras.

    Args:
        node: the node.

    Attributes:
        lock: held while the node is changed or asked.
    """

    def __init__(self, node: Any) -> None:
        self.node = node
        self.lock = threading.Lock()
        self._made_s = time.monotonic()

    def problem_of(self, topic: str) -> str:
        """Returns why no messages of a topic can be shown, for people; empty if nothing is known to be wrong.

        Nothing is subscribed for it.
        """
        try:
            with self.lock:
                endpoints = self.node.get_publishers_info_by_topic(topic)
        except Exception as error:  # noqa: BLE001  # a peer's name that is not UTF-8, a middleware's error
            return _can_not_be_examined(topic, error)
        types = {each.topic_type for each in endpoints}
        if types & READERS.keys() or (not types and time.monotonic() - self._made_s < DISCOVERY_S):
            return ""
        return _publishers_problem(topic, types)


class Camera:
    """Takes the newest message of a topic; used by one thread.

    Args:
        graph: where the topic is.
        topic: its full name.

    Attributes:
        problem: why no messages come, for people; empty if nothing is known to be wrong.
        type_name: of the messages that are taken; empty before there is a subscription.
    """

    def __init__(self, graph: Graph, topic: str) -> None:
        self._graph, self._topic = graph, topic
        self._subscription: Any = None
        self._message_type: Any = None
        self._reliable = False
        self._examine_at_s = 0.0
        self.problem = ""
        self.type_name = ""

    def examine(self) -> None:
        """Adapts the subscription to the publishers, twice a second."""
        now_s = time.monotonic()
        if now_s < self._examine_at_s:
            return
        self._examine_at_s = now_s + EXAMINE_EVERY_S
        try:
            with self._graph.lock:
                self._follow(self._graph.node.get_publishers_info_by_topic(self._topic))
        except TypeMissingError as error:
            self.problem = str(error)
        except Exception as error:  # noqa: BLE001  # a peer's name that is not UTF-8, a middleware's error
            if self._subscription is None:
                self.problem = _can_not_be_examined(self._topic, error)

    def wait(self, timeout_s: float) -> bool:
        """Waits for a message; False if none came in time, or there is no subscription."""
        if self._subscription is None:
            return False
        with self._subscription.handle, self._graph.node.context.handle:
            waiting = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, self._graph.node.context.handle)
            with waiting:
                waiting.clear_entities()
                waiting.add_subscription(self._subscription.handle)
                waiting.wait(int(timeout_s * _NS_PER_S))
                return bool(waiting.get_ready_entities("subscription"))

    def take(self) -> tuple[bytes, int] | None:
        """Returns the newest message, and when it arrived, ns since 1970; None if there is none.

        Raises:
            Exception: rclpy's; nothing has been taken.
        """
        taken = self._subscription.handle.take_message(self._message_type, True)
        return None if taken is None else (taken[0], taken[1]["received_timestamp"])

    def close(self) -> None:
        """Ends the subscription."""
        if self._subscription is not None:
            with self._graph.lock:
                self._graph.node.destroy_subscription(self._subscription)
            self._subscription = None

    def _follow(self, endpoints: Sequence[Any]) -> None:
        types = {each.topic_type for each in endpoints}
        type_name = next(
            (each for each in (self.type_name, *READERS) if each in types and each in READERS), ""
        )
        if not type_name:
            self.problem = _publishers_problem(self._topic, types)
            return
        reliable = all(
            each.qos_profile.reliability == ReliabilityPolicy.RELIABLE
            for each in endpoints
            if each.topic_type == type_name
        )
        if (type_name, reliable) != (self.type_name, self._reliable) or self._subscription is None:
            self._subscribe(type_name, reliable=reliable)
        self.problem = ""

    def _subscribe(self, type_name: str, *, reliable: bool) -> None:
        """Replaces the subscription by one that all publishers match (DDS 2.2.3)."""
        message_type = message_class(type_name)
        if self._subscription is not None:
            self._graph.node.destroy_subscription(self._subscription)
            self._subscription = None
        profile = QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=1,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.VOLATILE,
        )
        self._subscription = subscribe_raw(self._graph.node, message_type, self._topic, profile)
        self._message_type, self.type_name, self._reliable = message_type, type_name, reliable


def _publishers_problem(topic: str, types: Collection[str]) -> str:
    """Returns why a topic with none of the image types can't be shown."""
    if not types:
        return f"nothing publishes {topic}"
    return f"{topic} is published as {', '.join(sorted(types))}, not as {' or '.join(READERS)}"


def _can_not_be_examined(topic: str, error: Exception) -> str:
    return f"the publishers of {topic} can't be examined: {error}"
