"""One robot for the tests of a module: starting it takes seconds."""

from collections.abc import Iterator

import pytest

from tests.support.driving import Driving, driving


@pytest.fixture(scope="module")
def robot(
    module_ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Driving]:
    with driving(tmp_path_factory.mktemp("drive")) as made:
        yield made
