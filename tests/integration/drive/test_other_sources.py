"""Which of the nodes that take velocities counts as the multiplexer, whose other inputs a reset minds."""

import time

import pytest

from common.ros_node import message_class, ros_node
from tests.support.driving import Driving
from tests.support.undisturbed import undisturbed
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timed]

LISTENED_NS = 5_000_000_000
"""Longer than the drive program takes to find an input, and to hear what is published there."""


def test_an_observer_of_all_topics_is_no_multiplexer(robot: Driving) -> None:
    """As `ros2 bag record -a`, which takes our velocities, and measured ones that are never exactly zero."""
    stamped = message_class("geometry_msgs/msg/TwistStamped")
    message = stamped()
    message.twist.linear.x = 0.001

    def attempt() -> None:
        with ros_node("rosbag2_recorder") as recorder, ros_node("wheels") as wheels:
            for topic in ("/cmd_vel_keyboard", "/wheels/velocity"):
                recorder.create_subscription(stamped, topic, print, 10)
            measured = wheels.create_publisher(stamped, "/wheels/velocity", 10)
            peer, obstacles = robot.ready(), set()
            with robot.same_worker():
                peer.send(stop="ben")
                robot.phase_is("STOPPED")
                since_ns = time.monotonic_ns()

                def time_has_passed() -> bool:
                    measured.publish(message)
                    state = robot.state()
                    obstacles.add(state.reset_obstacle)
                    return state.monotonic_ns > since_ns + LISTENED_NS

                wait_until(time_has_passed, "any input is found")
                assert not [each for each in obstacles if "/wheels" in each]
                robot.robot.change(commander="autonomy", speed_mps=0.2, turn_rad_s=0)
                wait_until(lambda: "/cmd_vel_autonomy" in robot.state().reset_obstacle, "an input is heard")

    try:
        undisturbed(attempt)
    finally:
        robot.robot.change(commander="nobody", speed_mps=0.0)
