"""The whole system in containers, for the tests here that need it; those count as tests that need Docker."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.deployment import Deployment, demo_overlay, deployed

HERE = Path(__file__).parent


@pytest.fixture
def demo(tmp_path: Path, images: str) -> Iterator[Deployment]:
    """The whole system with a simulated robot, ready, for this test alone."""
    with deployed(tmp_path, demo_overlay()) as deployment, deployment.client() as robot:
        deployment.wait_for_status(robot)
        yield deployment
