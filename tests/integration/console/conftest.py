"""A robot's gateway in the test's process, and its address."""

from collections.abc import Iterator

import pytest

from tests.support.gateway_double import GatewayDouble, serving


@pytest.fixture
def double() -> GatewayDouble:
    return GatewayDouble()


@pytest.fixture
def target(double: GatewayDouble) -> Iterator[str]:
    with serving(double) as port:
        yield f"127.0.0.1:{port}"
