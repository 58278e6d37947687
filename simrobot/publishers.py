"""The simulated robot's ROS 2 node, with one publisher per topic."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile

from common.ros_node import ros_node
from simrobot.behaviour import Topic
from simrobot.messages import PUBLICATIONS
from simrobot.robot import Robot

_DEPTH = 10
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@contextmanager
def publishing(robot: Robot, topics: frozenset[Topic]) -> Iterator[Mapping[Topic, Callable[[], None]]]:
    """Yields a function per topic that builds and publishes one message, or none while the topic is silent.

    Raises:
        UserError: the middleware can't start.
    """
    with ros_node("simulated_robot", parameters=True) as node:
        yield {topic: _publisher(node, robot, topic) for topic in topics}


def _publisher(node: Any, robot: Robot, topic: Topic) -> Callable[[], None]:
    publication = PUBLICATIONS[topic]
    qos = _LATCHED if publication.latched else QoSProfile(depth=_DEPTH)
    publisher = node.create_publisher(publication.message_type, publication.topic, qos)
    return partial(_publish, node.get_clock(), publisher, robot, topic)


def _publish(clock: Any, publisher: Any, robot: Robot, topic: Topic) -> None:
    if topic in robot.behaviour.silent:
        return
    message = PUBLICATIONS[topic].build(robot, time.monotonic())
    if message is None:
        return
    if hasattr(message, "header"):
        message.header.stamp = clock.now().to_msg()
    publisher.publish(message)
