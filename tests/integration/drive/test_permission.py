"""What forbids a pulse of the doctor; tests/integration/drive/test_pulse.py leaves one out for that.

Nothing moves here, and nothing is timed: a stall delays a test, and no more.
"""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from common import config
from common.ros_node import OwnNode, message_class, ros_node
from drive.config import DriveSettings
from drive.doctor.permission import Permission
from tests.support.driving import Driving
from tests.support.waiting import wait_until

pytestmark = pytest.mark.ros

STOP_TOPIC = "/stop_button"
END_S = 30


@contextmanager
def permission(robot: Driving, **changes: Any) -> Iterator[Permission]:
    """As the process of a pulse asks for it.

    Args:
        robot: that would be moved.
        changes: of the drive program's settings.
    """
    settings = config.load(DriveSettings, robot.directory / "drive.yaml").model_copy(update=changes)
    with ros_node(OwnNode.DRIVE_PULSE) as node, closing(Permission(node, settings)) as asked:
        yield asked


def test_a_stop_that_is_latched_forbids_it_also_while_the_drive_program_does_not_run(robot: Driving) -> None:
    robot.ready().send(stop="ben")
    robot.phase_is("STOPPED")
    assert robot.guard
    robot.guard.terminate()
    robot.guard.wait(END_S)
    wait_until(lambda: robot.observer.state() is None, "the drive program has gone")
    with permission(robot) as asked:
        assert asked.refusal() == "the robot was stopped by ben, and robot-drive does not run"


def test_a_drive_program_that_cant_be_asked_forbids_it(robot: Driving, tmp_path: Path) -> None:
    robot.ready()
    elsewhere = tmp_path / "other.sock"
    expected = f"robot-drive runs, but nothing listens at {elsewhere}"
    with permission(robot, socket=elsewhere, state_dir=tmp_path) as asked:
        wait_until(lambda: asked.refusal() == expected, "its node is discovered")


def test_the_robots_own_stop_forbids_it_until_it_is_released(robot: Driving) -> None:
    boolean = message_class("std_msgs/msg/Bool")
    robot.ready()
    with permission(robot, stop_topics=(STOP_TOPIC,)) as asked, ros_node("button") as button:
        publisher = button.create_publisher(boolean, STOP_TOPIC, 1)

        def refusal_of(*, pressed: bool) -> str:
            publisher.publish(boolean(data=pressed))
            return asked.refusal()

        expected = f"the robot's own stop is active on {STOP_TOPIC}"
        wait_until(lambda: asked.refusal() == expected, "a stop that says nothing counts as pressed")
        wait_until(lambda: not refusal_of(pressed=False), "it is released")
        wait_until(lambda: refusal_of(pressed=True) == expected, "it is pressed")
