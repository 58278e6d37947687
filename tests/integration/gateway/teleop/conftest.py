"""One robot serves all tests of a module, in a ROS domain of its own."""

from collections.abc import Iterator

import pytest

from tests.support.driven_robot import DrivenRobot, driven_robot


@pytest.fixture(scope="module")
def robot(module_ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[DrivenRobot]:  # noqa: ARG001
    with driven_robot(tmp_path_factory.mktemp("robot")) as robot:
        yield robot
