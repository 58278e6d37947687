"""The programs beside nodes of another user, with the environment of compose.yaml and without."""

import json
import re
from pathlib import Path

import pytest
import yaml

from common import ros_transport
from console.client.blocking import GatewayClient
from console.client.errors import DeadlineExceeded, Unreachable
from tests.support.free import free_tcp_port
from tests.support.other_user import GATEWAY, ORDINARY, directory_of, running_as, simulated_robot_as
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros]

COMPOSE = Path(__file__).parents[4] / "compose.yaml"
ROOT_USER = (0, 0)


def environment_of_the_containers() -> dict[str, str]:
    """Without the domain, which is the test's own."""
    values = yaml.safe_load(COMPOSE.read_text(encoding="utf-8"))["x-ros-environment"]
    del values["ROS_DOMAIN_ID"]
    return {name: re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", value) for name, value in values.items()}


@pytest.mark.parametrize("robots", [ORDINARY, ROOT_USER, GATEWAY])
def test_the_gateway_hears_the_robots_nodes_of_any_user(
    robots: tuple[int, int],
    ros_domain: int,  # noqa: ARG001  # for its effect
) -> None:
    port = free_tcp_port()
    environment = {
        **environment_of_the_containers(),
        "GATEWAY__GRPC__PORT": str(port),
        "GATEWAY__PREVIEW__SOCKET": "/nowhere/preview.sock",
    }
    serve = ("-c", "from gateway.cli import main; main()", "serve")

    def odometry_arrives() -> bool:
        try:
            odometry = operator.status().odometry
        except (Unreachable, DeadlineExceeded):
            return False
        return odometry.available and not odometry.stale

    with (
        simulated_robot_as(robots),
        directory_of(GATEWAY) as home,
        running_as(GATEWAY, home, *serve, environment=environment),
        GatewayClient(f"127.0.0.1:{port}") as operator,
    ):
        wait_until(odometry_arrives, "odometry of another user's node reaches the operator", 20)


@pytest.mark.parametrize("program", ["gateway", "recorder"])
def test_the_doctor_says_why_nodes_of_another_user_would_stay_silent(
    program: str,
    ros_domain: int,  # noqa: ARG001  # for its effect
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv(ros_transport.VARIABLE)

    def finding(**environment: str) -> dict[str, str]:
        main = ("-c", f"from {program}.cli import main; main()", "doctor", "--json")
        with running_as(GATEWAY, home, *main, environment=environment) as process:
            listed = json.loads(process.communicate(timeout=60)[0])["findings"]
        (found,) = [each for each in listed if each["check"] == "ros.transport"]
        return dict(found)

    with simulated_robot_as(ORDINARY), directory_of(GATEWAY) as home:
        silent = finding()
        assert (silent["verdict"], "user 1000" in silent["what"]) == ("wrong", True)
        name, _, value = (
            silent["remedy"].partition(" in the environment")[0].removeprefix("Set ").partition("=")
        )
        assert finding(**{name: value})["verdict"] == "good"
