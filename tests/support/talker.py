"""A ROS node beside the gateway's, in a context of its own, that publishes what a test wants."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile

from gateway.ros.intake import Intake
from tests.support.waiting import wait_until


@dataclass
class Talker:
    """Publishes through real rclpy."""

    node: Any
    _publishers: dict[tuple[str, Any], Any] = field(default_factory=dict)

    def publisher(self, topic: str, message_type: Any, **qos: Any) -> Any:
        """The node's publisher on a topic; the first call makes it. Reliable, keep last 10 by default."""
        key = topic, message_type
        if key not in self._publishers:
            profile = QoSProfile(depth=qos.pop("depth", 10), **qos)
            self._publishers[key] = self.node.create_publisher(message_type, topic, profile)
        return self._publishers[key]

    def meet(self, running: Intake, topic: str, message_type: Any, voices: int = 1) -> Any:
        """The publisher on a topic, as soon as it and the gateway's source know each other.

        Each side finds the other in its own time; what is sent best-effort before both have is lost.
        """
        publisher = self.publisher(topic, message_type)
        source = next(source for source in running.sources.values() if source.topic == topic)
        wait_until(
            lambda: publisher.get_subscription_count() > 0 and source.publisher_count >= voices,
            f"{voices} publishers and a subscriber on {topic}",
        )
        return publisher

    def say(self, running: Intake, topic: str, message: Any, voices: int = 1) -> None:
        """Publishes one message as soon as the gateway listens."""
        self.meet(running, topic, type(message), voices).publish(message)

    def fall_silent(self, topic: str, message_type: Any) -> None:
        """Takes the publisher out of the graph."""
        self.node.destroy_publisher(self._publishers.pop((topic, message_type)))


@pytest.fixture
def talker(ros_domain: int) -> Iterator["Talker"]:  # noqa: ARG001  # for its effect
    """A talker in a domain of the test's own."""
    with talking() as made:
        yield made


@contextmanager
def talking(name: str = "talker") -> Iterator[Talker]:
    """A talker in the domain of the environment."""
    context = Context()
    context.init(args=[], initialize_logging=False)
    node = Node(name, context=context, use_global_arguments=False, enable_rosout=False)
    try:
        yield Talker(node)
    finally:
        node.destroy_node()
        context.shutdown()
        context.destroy()
