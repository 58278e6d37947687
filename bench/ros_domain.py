"""A ROS domain for what is measured."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.support.free import free_domain


@contextmanager
def ros_domain(**more: str) -> Iterator[None]:
    """Gives the block a ROS domain of its own, which the programs that it starts inherit.

    No other variable is set anew, as `mock.patch.dict` does at its end: threads of gRPC's may be reading.

    Args:
        more: further variables for the block.
    """
    with free_domain() as domain, pytest.MonkeyPatch.context() as patch:
        own = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        for name, value in {**own, **more}.items():
            patch.setenv(name, value)
        yield
