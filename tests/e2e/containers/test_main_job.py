"""The main job through the containers, on the compose file itself."""

import time

import pytest

from common.healthcheck import state_of
from console.client.results import PreviewProfile, PreviewState
from tests.e2e.containers.deployment import Deployment, is_healthy, status_with, udp_ports
from tests.support.promise import keeps
from tests.support.waiting import wait_until
from tests.support.watcher import Watcher

pytestmark = [pytest.mark.docker, pytest.mark.gst, pytest.mark.timeout(900)]


def test_status_then_video_then_quiet(demo: Deployment) -> None:
    with demo.client() as robot:
        # A source that stood still with the machine is stale for a moment.
        status = status_with(robot, is_healthy, "all is well")
        assert status.preview.state is PreviewState.DISABLED

        change = robot.enable_preview(PreviewProfile.BALANCED)
        assert change.accepted
        assert change.preview.state is PreviewState.RUNNING
        assert change.preview.endpoint
        assert (change.preview.endpoint.host, change.preview.endpoint.port) == (
            "127.0.0.1",
            demo.preview_port,
        )
        with Watcher(demo.preview_port) as viewer:
            viewer.wait_for_frames(60)
            assert demo.preview_port in udp_ports(demo, "preview")

        assert robot.disable_preview().preview.state is PreviewState.DISABLED
        assert demo.preview_port not in udp_ports(demo, "preview"), "the port is free again"


def test_health_by_the_standard_service_inside_and_out(demo: Deployment) -> None:
    demo.wait_healthy("gateway", "preview")
    target = f"127.0.0.1:{demo.gateway_port}"
    assert state_of(target) == "SERVING"
    assert state_of(target, "omniseer.gateway.v1.RobotGateway") == "SERVING"
    assert state_of(target, "preview") == "SERVING"
    assert state_of(target, "nobody").startswith("NOT_FOUND")

    demo.run("stop", "preview")
    wait_until(lambda: state_of(target, "preview") == "NOT_SERVING", "the gateway knows that it is gone")
    assert state_of(target) == "SERVING", "a dead preview is no fault of the gateway's"


@pytest.mark.timed
@pytest.mark.parametrize("service", ["gateway", "preview"])
def test_a_stop_takes_less_than_three_seconds(demo: Deployment, service: str) -> None:
    def took_s() -> float:
        demo.reset()
        with demo.client() as robot:
            robot.enable_preview()
        asked_s = time.time()
        demo.run("stop", service)
        # The engine would kill after stop_grace_period, with code 137: it ended by itself, and in time.
        assert demo.inspect(service)["State"]["ExitCode"] == 0, demo.logs(service)
        return demo.time_s(service, "FinishedAt") - asked_s

    keeps(3.0, f"s until {service} has stopped", took_s)


@pytest.mark.timed
def test_it_is_healthy_a_minute_after_docker_compose_up(demo: Deployment) -> None:
    """As docs/deploy.md says of the start."""

    def took_s() -> float:
        demo.run("stop")
        began_s = time.monotonic()
        demo.run("up", "--detach")
        demo.wait_healthy("gateway", "preview")
        with demo.client() as robot:
            demo.wait_for_status(robot)
        return time.monotonic() - began_s

    keeps(60.0, "s from docker compose up -d to a healthy robot", took_s)
