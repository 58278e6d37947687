"""compose.yaml as the robot runs it: the host's network and shared memory, beside the robot's own nodes."""

import json
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from tests.e2e.containers.deployment import Deployment, deployed
from tests.support.helper import helper
from tests.support.ros import simulated_robot
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.docker, pytest.mark.ros, pytest.mark.timeout(900)]


@contextmanager
def on_the_robot(directory: Path) -> Iterator[Deployment]:
    """Gateway and preview in a ROS domain of their own that does not leave this machine."""
    config = directory / "gateway.yaml"
    with deployed(
        directory, up=False, GATEWAY_CONFIG=str(config), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST"
    ) as deployment:
        config.write_text(f"grpc: {{port: {deployment.gateway_port}}}\n", encoding="utf-8")
        yield deployment


@pytest.mark.usefixtures("images")
def test_a_killed_gateway_costs_the_robots_own_pair_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with on_the_robot(tmp_path) as deployment, deployment.client() as operator:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(deployment.domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        with (
            simulated_robot(tmp_path),
            helper("tests.support.pair", "listen") as listener,
            helper("tests.support.pair", "talk") as talker,
        ):
            assert talker.stdout
            assert talker.stdout.readline() == "met\n"
            deployment.compose.start()
            deployment.wait_for_status(operator)

            def restarted(more_than: int) -> bool:
                return deployment.restarts("gateway") > more_than

            for kill in range(3):
                deployment.signal_all("gateway", signal.SIGKILL)
                wait_until(partial(restarted, kill), "the engine starts it again", 30)
                deployment.wait_for_status(operator)
            sent = int(talker.communicate("", timeout=20)[0])
            got = json.loads(listener.communicate("", timeout=20)[0])
        assert sent > 200
        assert got == list(range(sent))
