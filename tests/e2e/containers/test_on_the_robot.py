"""compose.yaml as the robot runs it: in the host's network, beside the robot's own nodes."""

import json
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import pytest

from console.client import DeadlineExceeded, GatewayClient, PreviewState, Unreachable
from console.client.results import RecorderState, StreamEndpoint, SystemStatus
from console.receiver.address import StreamAddress
from console.receiver.errors import StreamRefusedError
from tests.e2e.containers.deployment import Deployment, deployed, status_with
from tests.support.helper import helper
from tests.support.other_user import ORDINARY, simulated_robot_as
from tests.support.receiver import Receiver
from tests.support.robotctl import robotctl_process
from tests.support.ros import simulated_robot
from tests.support.waiting import wait_until
from tests.support.watcher import Watcher

pytestmark = [pytest.mark.docker, pytest.mark.ros, pytest.mark.timeout(900)]


@contextmanager
def on_the_robot(directory: Path, bind: str = "127.0.0.1") -> Iterator[Deployment]:
    """Gateway and preview in a ROS domain of their own that does not leave this machine."""
    with deployed(
        directory,
        up=False,
        GATEWAY_CONFIG=str(directory / "gateway.yaml"),
        ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
        PREVIEW_BIND=bind,
    ) as deployment:
        configure(directory, deployment)
        yield deployment


def configure(directory: Path, deployment: Deployment, more: str = "") -> None:
    """Writes the gateway's configuration."""
    config = f"grpc: {{port: {deployment.gateway_port}}}\n{more}"
    (directory / "gateway.yaml").write_text(config, encoding="utf-8")


def stream_of(operator: GatewayClient) -> StreamEndpoint:
    """Where to watch a preview that runs."""

    def running() -> StreamEndpoint | None:
        with suppress(Unreachable, DeadlineExceeded):
            preview = operator.enable_preview().preview
            return preview.endpoint if preview.state is PreviewState.RUNNING else None
        return None

    return wait_until(running, "the preview runs", 40)


def plain_player_is_refused(port: int) -> bool:
    with Receiver(StreamAddress("127.0.0.1", port)) as receiver:
        try:
            receiver.next_frame(timeout_s=20)
        except StreamRefusedError as error:
            return "passphrase" in str(error)
        return False


@pytest.mark.usefixtures("images")
@pytest.mark.parametrize(
    ("bind", "encrypted", "logged"),
    [
        ("0.0.0.0", True, "the video is encrypted; its listener is at 0.0.0.0"),  # noqa: S104  # the default
        (
            "127.0.0.1",
            False,
            "the video is not encrypted; its listener at 127.0.0.1",
        ),
    ],
)
def test_the_published_address_decides_whether_the_video_is_encrypted(
    tmp_path: Path, bind: str, encrypted: bool, logged: str
) -> None:
    """What docs/deploy.md says of PREVIEW_BIND, and of players without a passphrase."""
    with on_the_robot(tmp_path, bind) as deployment, deployment.client() as operator:
        deployment.compose.start()
        stream = stream_of(operator)
        assert (stream.encrypted, bool(stream.passphrase)) == (encrypted, encrypted)
        with Watcher(deployment.preview_port, stream.passphrase) as watcher:
            watcher.wait_for_frames(10)
        assert plain_player_is_refused(deployment.preview_port) is encrypted
        assert logged in deployment.logs("gateway")

        configure(tmp_path, deployment, "preview: {encrypted: false}\n")
        deployment.run("up", "--detach", "--force-recreate", "gateway")
        wait_until(lambda: not stream_of(operator).encrypted, "the running preview is plain", 40)
        with Watcher(deployment.preview_port) as watcher:
            watcher.wait_for_frames(10)
        warned = f"anyone who reaches its listener at {bind}" in deployment.logs("gateway")
        assert warned is encrypted, "where other machines reach it"


@pytest.mark.usefixtures("images")
def test_nodes_of_another_user_reach_the_operator_and_the_recorder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The gateway is user 10001 and the recorder 10004; an ordinary user of the host publishes."""
    (tmp_path / "recorder.yaml").write_text(
        "room: {min_free_bytes: 0}\npresets: {motion: {topics: [/odometry/filtered]}}\n", encoding="utf-8"
    )
    with deployed(
        tmp_path,
        up=False,
        GATEWAY_CONFIG=str(tmp_path / "gateway.yaml"),
        RECORDER_CONFIG=str(tmp_path / "recorder.yaml"),
        COMPOSE_PROFILES="record",
    ) as deployment:
        configure(tmp_path, deployment, "recording: {socket: /run/robot-recorder/recorder.sock}\n")
        monkeypatch.setenv("ROS_DOMAIN_ID", str(deployment.domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        with simulated_robot_as(ORDINARY), deployment.client() as operator:

            def recorder_is_idle(status: SystemStatus) -> bool:
                recording = status.recording
                return recording is not None and recording.state is RecorderState.IDLE

            def messages_are_written(status: SystemStatus) -> bool:
                recording = status.recording
                return recording is not None and recording.messages_written > 0

            deployment.compose.start()
            deployment.wait_for_status(operator)
            status_with(operator, recorder_is_idle, "the recorder is idle", 60)
            begun = robotctl_process("--target", deployment.target, "record", "start", "--json")
            assert begun.returncode == 0, begun.stderr
            status_with(operator, messages_are_written, "messages are recorded", 30)
            for program in ("gateway", "recorder"):
                asked = deployment.run(
                    "exec", "-T", program, f"robot-{program}", "doctor", "--json", check=False
                )
                findings = json.loads(asked.stdout)["findings"]
                (read,) = [each["what"] for each in findings if each["check"] in ("configuration", "config")]
                assert read.startswith(f"/etc/robot-gateway/{program}.yaml: "), "not the program's own"
                assert "ros.transport" in {each["check"] for each in findings}, asked.stdout
                assert [each for each in findings if each["verdict"] == "wrong"] == [], asked.stderr


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
