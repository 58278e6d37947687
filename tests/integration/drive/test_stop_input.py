"""The robot's own stop: a topic that says nothing counts as pressed."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile

from common.ros_node import message_class, ros_node
from omniseer.drive.v1 import drive_pb2 as pb
from tests.support.driving import Driving, driving
from tests.support.helper import helper
from tests.support.undisturbed import undisturbed
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timed]

TOPIC = "/stop_button"
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
VOLATILE = QoSProfile(depth=1)


@pytest.fixture(scope="module")
def robot(
    module_ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Driving]:
    """One with a stop of its own, which is pressed between two tests."""
    with driving(tmp_path_factory.mktemp("drive"), stop_topics=[TOPIC]) as made:
        yield made


@pytest.mark.parametrize("qos", [LATCHED, VOLATILE], ids=["latched", "volatile"])
def test_it_is_pressed_until_a_live_publisher_says_otherwise(robot: Driving, qos: Any) -> None:
    boolean = message_class("std_msgs/msg/Bool")

    def attempt() -> None:
        peer = robot.ready()
        with robot.same_worker():
            wait_until(lambda: pb.INHIBIT_ROBOT_STOP in robot.state().inhibits, "known without a driver")
            peer.send(lease="anna", held=False)
            robot.phase_is("INHIBITED")
            wait_until(lambda: list(robot.state().inhibits) == [pb.INHIBIT_ROBOT_STOP], "the one reason")
            with ros_node("button") as button:
                publisher = button.create_publisher(boolean, TOPIC, qos)
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

    undisturbed(attempt)


@contextmanager
def leased(robot: Driving) -> Iterator[None]:
    """A driver who does not hold, so that a reason inhibits, and its end arms; see `Driving.same_worker`."""
    peer = robot.ready()
    with robot.same_worker():
        peer.send(lease="anna", held=False)
        robot.phase_is("INHIBITED", "ARMED")
        yield


def test_what_one_publisher_has_pressed_no_other_releases(robot: Driving) -> None:
    boolean = message_class("std_msgs/msg/Bool")

    def attempt() -> None:
        with leased(robot), ros_node("button") as button, ros_node("other") as other:
            pressing = button.create_publisher(boolean, TOPIC, LATCHED)
            pressing.publish(boolean(data=False))
            robot.phase_is("ARMED")
            releasing = other.create_publisher(boolean, TOPIC, LATCHED)
            wait_until(lambda: "2 publishers" in " ".join(robot.state().problems), "both are seen")
            pressing.publish(boolean(data=True))
            releasing.publish(boolean(data=False))
            later_ns = time.monotonic_ns() + 500_000_000
            wait_until(lambda: robot.state().monotonic_ns > later_ns, "many cycles")
            assert pb.INHIBIT_ROBOT_STOP in robot.state().inhibits
            pressing.publish(boolean(data=False))
            button.destroy_publisher(pressing)
            robot.phase_is("ARMED")
            assert not robot.state().problems

    undisturbed(attempt)


def test_a_press_that_is_released_at_once_counts(robot: Driving) -> None:
    boolean = message_class("std_msgs/msg/Bool")
    with ros_node("button") as button:
        # Latched, for a worker that takes the place of a lost one.
        qos = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        publisher = button.create_publisher(boolean, TOPIC, qos)
        publisher.publish(boolean(data=False))

        def attempt() -> None:
            robot.drive()
            with robot.moving():
                for pressed in (True, False):
                    publisher.publish(boolean(data=pressed))
                robot.inhibited()
            robot.settled()

        undisturbed(attempt)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_publisher_that_is_silent_counts_as_pressed_where_that_is_configured(
    tmp_path: Path,
    ros_domain: int,  # noqa: ARG001  # for its effect
    number: signal.Signals,
) -> None:

    def attempt() -> None:
        with helper("tests.support.stop_button", TOPIC) as button:
            impatient.drive()
            with impatient.moving():
                button.send_signal(number)
                began_ns = time.monotonic_ns()
                assert pb.INHIBIT_ROBOT_STOP in impatient.inhibited().inhibits
                impatient.settled()
                assert impatient.witness.zero_after_ms(began_ns) < 1000

    with driving(tmp_path, stop_topics=[TOPIC], stop_timeout_ms=500) as impatient:
        undisturbed(attempt)
