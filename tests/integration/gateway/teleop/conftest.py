"""One robot serves all tests of a module, in a ROS domain of its own."""

from collections.abc import Iterator

import pytest

from tests.support.driven_robot import DrivenRobot, driven_robot
from tests.support.free import free_domain


@pytest.fixture(scope="module")
def domain() -> Iterator[int]:
    """In force for this process and its children; nothing leaves the machine."""
    with free_domain() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield domain


@pytest.fixture(scope="module")
def robot(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[DrivenRobot]:  # noqa: ARG001
    with driven_robot(tmp_path_factory.mktemp("robot")) as robot:
        yield robot
