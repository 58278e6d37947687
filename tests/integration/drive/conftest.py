"""One robot for the tests of a module: starting it takes seconds."""

from collections.abc import Iterator

import pytest

from tests.support.driving import Driving, driving
from tests.support.free import free_domain


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driving]:
    with free_domain() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        with driving(tmp_path_factory.mktemp("drive")) as made:
            yield made
