"""A camera that is a ROS topic, through compose.yaml as the robot runs it: from the topic to a viewer."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

import pytest

from console.client import CameraState
from console.client.results import SystemStatus
from tests.e2e.containers.deployment import Deployment, deployed, status_with
from tests.support.colour_eye import Eye
from tests.support.ros_camera import picture, ros_camera
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.docker, pytest.mark.ros, pytest.mark.gst, pytest.mark.timeout(900)]

TOPIC = "/arm/image_raw"
# As in docs/configuration.md, with test pictures where that has USB cameras.
CAMERAS = f"""
cameras:
  front: {{kind: test, pattern: red}}
  rear: {{kind: test, pattern: blue}}
  arm: {{kind: ros, topic: {TOPIC}, fps: 15, fallback: front}}
# A machine that stands still for 3 s makes no camera silent.
timeouts: {{start_s: 20, source_silence_s: 5, encoder_silence_s: 5}}
"""
UP_WITHIN_S = BACK_WITHIN_S = 60.0


@contextmanager
def robot_with_cameras(directory: Path) -> Iterator[Deployment]:
    """One with the camera tap, in a ROS domain of its own, which is this process's as well."""
    gateway, preview = directory / "gateway.yaml", directory / "preview.yaml"
    preview.write_text(CAMERAS, encoding="utf-8")
    with deployed(
        directory,
        up=False,
        COMPOSE_PROFILES="tap",
        GATEWAY_CONFIG=str(gateway),
        PREVIEW_CONFIG=str(preview),
        ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
    ) as robot:
        # Nothing but cameras.
        gateway.write_text(f"grpc: {{port: {robot.gateway_port}}}\nsources: []\n", encoding="utf-8")
        environment = {"ROS_DOMAIN_ID": str(robot.domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        with patch.dict(os.environ, environment):
            robot.compose.start()
            robot.wait_healthy("gateway", "preview")
            wait_until(lambda: robot.passes_its_check("tap"), "the tap is healthy", UP_WITHIN_S)
            yield robot


def state_of_arm(status: SystemStatus) -> CameraState | None:
    arm = status.preview.camera("arm")
    return arm.state if arm else None


def is_faulted(status: SystemStatus) -> bool:
    return any(fault.id == "preview.camera.arm" and fault.active for fault in status.faults)


@pytest.mark.usefixtures("images")
def test_a_topic_is_a_camera_beside_the_others_and_so_are_its_faults(tmp_path: Path) -> None:
    with robot_with_cameras(tmp_path) as robot, robot.client() as operator:
        with ros_camera(TOPIC, picture("green"), hz=15.0):
            status_with(operator, lambda now: state_of_arm(now) is CameraState.READY, "the topic is there")
            listed = robot.run("exec", "-T", "tap", "robot-tap", "doctor", check=False)
            assert TOPIC in listed.stdout, listed.stdout + listed.stderr
            operator.enable_preview(camera="front")
            with Eye(robot.preview_port) as eye:
                eye.sees("red")
                operator.enable_preview(camera="rear")
                eye.sees("blue")
                operator.enable_preview(camera="arm")
                eye.sees("green")
                status = status_with(
                    operator, lambda now: state_of_arm(now) is CameraState.LIVE, "the topic is live"
                )
                assert [camera.name for camera in status.preview.cameras] == ["front", "rear", "arm"]
                assert not is_faulted(status)
                assert eye.lost == [], "one SRT connection for all cameras"

                os.kill(robot.program_pid("tap"), signal.SIGKILL)
                eye.sees("red")
                wait_until(
                    lambda: robot.restarts("tap") >= 1, "the engine starts the tap again", BACK_WITHIN_S
                )
                eye.sees("green", BACK_WITHIN_S)
                assert eye.lost == []
        # Its publisher has ended.
        with Eye(robot.preview_port) as eye:
            eye.sees("red")
            status_with(operator, is_faulted, "the fault of the camera")
