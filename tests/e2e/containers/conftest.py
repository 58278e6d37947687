"""The whole system in containers, for the tests here that need it; those count as tests that need Docker."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import pytest

from tests.e2e.containers.deployment import Deployment, demo_overlay, deployed
from tests.support.distribution import shares_a_deployment

_SHARED: Final = pytest.StashKey[ExitStack]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """Ends the shared deployment with the last test of its files: every test after them would pay for it."""
    yield
    shared = item.session.stash.get(_SHARED, None)
    if shared and not (nextitem and shares_a_deployment(nextitem)):
        shared.close()


@pytest.fixture(scope="session")
def _shared_demo(
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
    images: str,  # noqa: ARG001  # for its effect
) -> Iterator[Deployment]:
    directory = tmp_path_factory.mktemp("demo")
    config = directory / "recorder.yaml"
    # Without a ring, so that the preview is off unless a test enables it or records it.
    config.write_text("room: {min_free_bytes: 0}\n", encoding="utf-8")
    with ExitStack() as shared:
        request.session.stash[_SHARED] = shared
        yield shared.enter_context(
            deployed(
                directory,
                demo_overlay(),
                COMPOSE_PROFILES="record,tap",
                ROBOT_RECORDS="true",
                RECORDER_CONFIG=str(config),
            )
        )


@pytest.fixture
def demo(_shared_demo: Deployment) -> Deployment:
    """The whole system with a simulated robot: containers up, preview and recording off, no restarts yet."""
    _shared_demo.reset()
    return _shared_demo


@pytest.fixture
def own_demo(tmp_path: Path, images: str) -> Iterator[Deployment]:  # noqa: ARG001  # for its effect
    """The same for this test alone, which leaves traces that a reset does not remove."""
    with deployed(tmp_path, demo_overlay()) as deployment, deployment.client() as robot:
        deployment.wait_for_status(robot)
        yield deployment
