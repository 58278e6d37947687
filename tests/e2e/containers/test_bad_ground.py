"""Wrong configurations, full disks, places that can't be written to."""

from pathlib import Path

import pytest

from console.client.results import PreviewState, SystemStatus
from tests.e2e.containers.deployment import Deployment, demo_overlay, deployed, status_with
from tests.support.waiting import wait_until
from tests.support.watcher import Watcher

pytestmark = [pytest.mark.docker, pytest.mark.gst, pytest.mark.timeout(900)]

WRONG = "grpc: {prot: 50051}\n"
THE_LINE = "unknown key 'grpc.prot'"


@pytest.mark.usefixtures("images")
def test_a_wrong_configuration_ends_the_start_with_one_line(tmp_path: Path) -> None:
    config = tmp_path / "gateway.yaml"
    config.write_text(WRONG, encoding="utf-8")
    with deployed(tmp_path, demo_overlay(), up=False, GATEWAY_CONFIG=str(config)) as deployment:
        up = deployment.run("up", "--detach", check=False)
        assert up.returncode != 0
        assert "gateway-config" in up.stderr
        lines = deployment.logs("gateway-config").splitlines()
        assert len(lines) == 1, lines
        assert THE_LINE in lines[0]
        gateway = deployment.inspect("gateway")
        assert gateway["State"]["Status"] == "created", (
            "the gateway itself was never started, so nothing loops"
        )


@pytest.mark.usefixtures("images")
def test_a_configuration_broken_later_is_reported_at_every_attempt(tmp_path: Path) -> None:
    config = tmp_path / "gateway.yaml"
    config.write_text("name: good\n", encoding="utf-8")
    with (
        deployed(tmp_path, demo_overlay(), GATEWAY_CONFIG=str(config)) as deployment,
        deployment.client() as robot,
    ):
        deployment.wait_for_status(robot)
        config.write_text(WRONG, encoding="utf-8")
        deployment.run("restart", "gateway")
        wait_until(lambda: deployment.restarts("gateway") >= 2, "the engine tries again", 60)
        # Between an exit and the next attempt the engine says 0: running.
        wait_until(
            lambda: deployment.inspect("gateway")["State"]["ExitCode"] == 2, "the attempt ends with 2", 60
        )
        said = [line for line in deployment.logs("gateway").splitlines() if THE_LINE in line]
        assert len(said) >= 2, "each attempt says why"
        assert "Traceback" not in deployment.logs("gateway")

        config.write_text("name: good\n", encoding="utf-8")
        deployment.wait_for_status(robot)


@pytest.mark.usefixtures("images")
def test_a_socket_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    with deployed(tmp_path, up=False) as deployment:
        done = deployment.run(
            "run", "--rm", "--no-deps", "-e", "PREVIEW__SOCKET=/etc/robot-gateway/preview.sock", "preview",
            check=False,
        )  # fmt: skip
        assert done.returncode == 1
        last = done.stderr.strip().splitlines()[-1]
        assert "socket /etc/robot-gateway/preview.sock can't be created" in last
        assert "Traceback" not in done.stderr


def fill(deployment: Deployment, service: str, directory: str) -> None:
    """Writes until nothing more goes in."""
    done = deployment.run(
        "exec", service, "dd", "if=/dev/zero", f"of={directory}/full", "bs=64k", check=False
    )
    assert "No space left on device" in done.stderr


def test_full_disks_stop_neither_status_nor_video(own_demo: Deployment) -> None:
    fill(own_demo, "preview", "/tmp")
    fill(own_demo, "preview", "/run/robot-gateway")
    fill(own_demo, "gateway", "/tmp")
    with own_demo.client() as robot:
        assert robot.enable_preview().preview.state is PreviewState.RUNNING
        with Watcher(own_demo.preview_port) as viewer:
            viewer.wait_for_frames(30)
        # The volume of the socket stays full, because the gateway holds it.
        own_demo.run("restart", "preview")
        status_with(robot, is_back, "the preview is back, and all else is well", 60)


def is_back(status: SystemStatus) -> bool:
    return status.preview.state is PreviewState.RUNNING and status.health.ready
