"""Every test here has a ROS domain of its own."""

from collections.abc import Iterator

import pytest

from tests.support.talker import Talker, talking


@pytest.fixture
def talker(ros_domain: int) -> Iterator[Talker]:  # noqa: ARG001  # for its effect
    with talking() as made:
        yield made
