"""The lock of a stop, at the double of twist_mux: what it silences, and when it is released."""

import time
from collections.abc import Callable

import pytest

from common.ros_node import message_class, ros_node
from drive.config import DriveSettings
from tests.support.driving import Driving
from tests.support.promise import MS, keeps
from tests.support.undisturbed import undisturbed
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timed]


def says(robot: Driving, text: str) -> Callable[[], bool]:
    """Whether the problems of the drive program have a text."""
    return lambda: text in " ".join(robot.state().problems)


def test_a_stop_silences_a_source_of_higher_priority(robot: Driving) -> None:
    """No zero passes such a source; until the reset nothing at all passes the lock."""

    def silenced_after_ms() -> float:
        peer = robot.ready()
        try:
            with robot.same_worker():
                since_ns = time.monotonic_ns()
                robot.robot.change(commander="unseen", speed_mps=0.2, turn_rad_s=0)
                wait_until(lambda: robot.witness.motion_since(since_ns), "the source has the robot")
                stopped_ns = time.monotonic_ns()
                peer.send(stop="ben")
                robot.phase_is("STOPPED")
                robot.settled()
                heard = len(robot.witness.seen)
                wait_until(lambda: not robot.state().reset_obstacle, "nothing has moved the base for 3 s")
                assert len(robot.witness.seen) == heard, "the base hears nothing"
                last_ns = max(robot.witness.motion_since(stopped_ns), default=stopped_ns)
                peer.send(reset=robot.state().stop.stop_id)
                robot.phase_is("AVAILABLE")
                reset_ns = time.monotonic_ns()
                wait_until(lambda: robot.witness.motion_since(reset_ns), "the source has the robot again")
                robot.robot.change(commander="nobody", speed_mps=0.0)
                peer.send(lease="anna", held=False)
                wait_until(lambda: not robot.witness.moves(), "zeros arrive again")
        finally:
            robot.robot.change(commander="nobody", speed_mps=0.0)
        return (last_ns - stopped_ns) / 1e6

    # Until a lock has once had an effect, the multiplexer may still be discovering its publisher.
    undisturbed(silenced_after_ms)
    keeps(400, "stop of a source of higher priority, ms", silenced_after_ms, per_stalled_s=MS)


def test_a_reset_releases_no_lock_that_another_program_may_hold(robot: Driving) -> None:
    boolean, topic = message_class("std_msgs/msg/Bool"), DriveSettings().lock_topic

    def attempt() -> None:
        peer = robot.ready()
        try:
            with robot.same_worker(), ros_node("button") as button:
                publisher = button.create_publisher(boolean, topic, 1)

                def is_released() -> bool:
                    publisher.publish(boolean(data=False))
                    return not robot.state().problems

                peer.send(stop="ben")
                robot.phase_is("STOPPED")
                shared = says(robot, f"button publishes the lock on {topic}, too")
                wait_until(shared, "it is said before a reset")
                wait_until(lambda: not robot.state().reset_obstacle, "it may be reset")
                publisher.publish(boolean(data=True))
                peer.send(reset=robot.state().stop.stop_id)
                robot.phase_is("AVAILABLE")
                wait_until(says(robot, f"the lock on {topic} is active"), "the lock that is left is named")
                assert says(robot, "(button)")()
                robot.robot.change(commander="autonomy", speed_mps=0.2, turn_rad_s=0)
                since_ns = time.monotonic_ns()
                wait_until(lambda: robot.state().monotonic_ns > since_ns + 1_000_000_000, "a second")
                assert not robot.witness.motion_since(since_ns)
                wait_until(is_released, "the button releases it")
                wait_until(lambda: robot.witness.motion_since(since_ns), "autonomy has the robot")
        finally:
            robot.robot.change(commander="nobody", speed_mps=0.0)

    undisturbed(attempt)


def test_the_next_worker_names_a_lock_that_is_left(robot: Driving) -> None:
    boolean, topic = message_class("std_msgs/msg/Bool"), DriveSettings().lock_topic
    active = says(robot, f"the lock on {topic} is active")

    def attempt() -> None:
        peer = robot.ready()
        with ros_node("button") as button:
            publisher = button.create_publisher(boolean, topic, 1)

            def is_released() -> bool:
                publisher.publish(boolean(data=False))
                return not robot.state().problems

            with robot.same_worker():
                peer.send(stop="ben")
                robot.phase_is("STOPPED")
                wait_until(says(robot, f"button publishes the lock on {topic}"), "the button is discovered")
                wait_until(lambda: not robot.state().reset_obstacle, "it may be reset")
                peer.send(reset=robot.state().stop.stop_id)
                robot.phase_is("AVAILABLE")
                wait_until(active, "the lock that is left is named")
            lost = robot.worker
            lost.kill()
            lost.wait(10)
            lost_ns = time.monotonic_ns()
            wait_until(lambda: robot.state().monotonic_ns > lost_ns, "a state of the next worker", 30)
            wait_until(active, "it is named")
            wait_until(says(robot, "(button)"), "and so is what publishes it")
            wait_until(is_released, "the button releases it")

    undisturbed(attempt)
