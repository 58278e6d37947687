"""The robot's own stop: a topic that says nothing counts as pressed."""

from pathlib import Path
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile

from common.ros_node import message_class, ros_node
from omniseer.drive.v1 import drive_pb2 as pb
from tests.support.driving import driving
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timed]

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
VOLATILE = QoSProfile(depth=1)


@pytest.mark.parametrize("qos", [LATCHED, VOLATILE], ids=["latched", "volatile"])
def test_it_is_pressed_until_a_live_publisher_says_otherwise(
    tmp_path: Path,
    ros_domain: int,  # noqa: ARG001  # for its effect
    qos: Any,
) -> None:
    boolean = message_class("std_msgs/msg/Bool")
    with driving(tmp_path, stop_topics=["/stop_button"]) as robot:
        peer = robot.ready()
        peer.send(lease="anna", held=False)
        robot.phase_is("INHIBITED")
        wait_until(lambda: list(robot.state().inhibits) == [pb.INHIBIT_ROBOT_STOP], "the one reason")
        with ros_node("button") as button:
            publisher = button.create_publisher(boolean, "/stop_button", qos)
            if qos is VOLATILE:
                wait_until(lambda: publisher.get_subscription_count() >= 2, "its subscribers")
            publisher.publish(boolean(data=False))
            robot.phase_is("ARMED")
            peer.send(held=True)
            robot.phase_is("DRIVING")
            publisher.publish(boolean(data=True))
            assert pb.INHIBIT_ROBOT_STOP in robot.phase_is("INHIBITED").inhibits
            peer.send(held=False)
            publisher.publish(boolean(data=False))
            robot.phase_is("ARMED")
        robot.phase_is("INHIBITED")
        wait_until(lambda: list(robot.state().inhibits) == [pb.INHIBIT_ROBOT_STOP], "the button has gone")
