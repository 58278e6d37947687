"""What is published on several outputs, of either type, as a subscriber of each receives it."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import pytest

from common.ros_node import message_class, ros_node
from drive.config import Output
from drive.motion.values import ZERO, Velocity
from drive.ros.base import VelocityPublisher
from drive.ros.subscriptions import NEWEST, newest, subscribe, velocity_of
from tests.support.waiting import wait_until

pytestmark = pytest.mark.ros

OUTPUTS = (
    Output(topic="/stamped", type="geometry_msgs/msg/TwistStamped", frame_id="body"),
    Output(topic="/plain", type="geometry_msgs/msg/Twist"),
)
MOTION = Velocity(0.1, -0.2, 0.3)


@contextmanager
def publishing() -> Iterator[tuple[VelocityPublisher, dict[str, Any]]]:
    """A publisher of all outputs, and the subscriptions that take them."""
    with ros_node("publisher") as publisher, ros_node("subscriber") as subscriber:
        taking = {each.topic: subscribe(subscriber, each.type, each.topic, NEWEST) for each in OUTPUTS}
        velocities = VelocityPublisher(publisher, OUTPUTS)
        wait_until(lambda: velocities.matched() == len(OUTPUTS), "all are matched")
        yield velocities, taking


def test_each_output_gets_every_velocity_in_its_own_type(ros_domain: int) -> None:  # noqa: ARG001
    with publishing() as (velocities, taking):
        for wanted in (MOTION, ZERO):
            velocities.publish(wanted)
            for output in OUTPUTS:
                message = wait_until(partial(newest, taking[output.topic]), f"one on {output.topic}")
                assert type(message) is message_class(output.type)
                assert velocity_of(message) == wanted
                if output.type.endswith("Stamped"):
                    assert message.header.frame_id == "body"
                    assert message.header.stamp.sec > 0
