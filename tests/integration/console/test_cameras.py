"""An operator chooses between cameras: robotctl, the gateway, the preview service and its video, all real."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from console.client import CameraState, CaughtUp, GatewayClient, InvalidRequest, PreviewState
from console.client.results import Event
from tests.support.patient import PATIENT
from tests.support.robotctl import robotctl
from tests.support.undisturbed import without_stall
from tests.support.video_ground import VideoGround, video_ground
from tests.support.waiting import wait_until
from tests.support.watcher import Watcher

pytestmark = pytest.mark.gst

CAMERAS = {
    "front": {"kind": "test", "pattern": "red"},
    "rear": {"kind": "test", "pattern": "blue", "fallback": "front"},
    "arm": {"kind": "v4l2", "device": "/dev/not-there"},
    "short": {
        "kind": "gst",
        "description": "videotestsrc is-live=true num-buffers=90",
        "fallback": "rear",
    },
}


@pytest.fixture
def ground(tmp_path: Path) -> Iterator[VideoGround]:
    with video_ground(tmp_path, {"cameras": CAMERAS}) as ground:
        yield ground


def on(ground: VideoGround, *words: str) -> tuple[int, str, str]:
    ended = robotctl("--target", ground.target, "preview", "on", *words)
    return ended.returncode, ended.stdout, ended.stderr


def test_switching_cameras_from_a_terminal(ground: VideoGround) -> None:
    code, out, _ = on(ground)
    assert code == 0
    assert "preview is running, balanced, camera front" in out
    assert "front (live)" in out
    with Watcher(ground.preview.port) as viewer:
        viewer.wait_for_frames(5)
        code, out, _ = on(ground, "--camera", "rear")
        assert code == 0
        assert "preview is running, balanced, camera rear" in out
        with GatewayClient(ground.target, PATIENT) as robot:
            wait_until(
                lambda: robot.status().preview.cameras[2].state is CameraState.FAILED,
                "arm is seen to be missing",
            )
        code, out, err = on(ground, "--camera", "arm")
        assert code == 1
        assert "camera arm does not work; camera rear is shown: camera arm: camera /dev/not-there" in err
        code, out, err = on(ground, "--camera", "back")
        assert code == 1
        assert "no camera is called 'back'; this robot has: front, rear, arm, short" in err
        code, out, _ = on(ground, "--camera", "front", "--profile", "low-bw")
        assert code == 0
        assert "preview is running, low-bw, camera front" in out
        viewer.wait_for_frames(5)
        assert viewer.lost == []
    status = json.loads(robotctl("--target", ground.target, "--json", "status").stdout)["preview"]
    assert status["wanted_camera"] == "front"
    assert [(each["name"], each["state"]) for each in status["cameras"]] == [
        ("front", "live"),
        ("rear", "ready"),
        ("arm", "failed"),
        ("short", "ready"),
    ]


@pytest.mark.timeout(300)
def test_what_a_program_learns_of_a_camera_that_fails(tmp_path: Path) -> None:
    def attempt(directory: Path) -> None:
        with (
            video_ground(directory, {"cameras": CAMERAS}) as ground,
            GatewayClient(ground.target, PATIENT) as robot,
        ):
            a_camera_fails(robot)

    # Without frames for a moment, as in a stall, a pipeline is started anew.
    without_stall(attempt, tmp_path)


def a_camera_fails(robot: GatewayClient) -> None:
    assert robot.enable_preview().preview.live_camera == robot.status().preview.camera("front")
    with pytest.raises(InvalidRequest, match="this robot has: front, rear"):
        robot.enable_preview(camera="nonsense")
    assert robot.enable_preview(camera="rear").preview.wanted_camera == "rear"
    robot.enable_preview(camera="short")
    # It ends after three seconds, and begins again beside its fallback, at growing distances.
    wait_until(
        lambda: any(fault.id == "preview.camera.short" and fault.active for fault in robot.status().faults),
        "the fault",
        30,
    )
    preview = robot.status().preview
    assert preview.state is PreviewState.RUNNING
    assert preview.wanted_camera == "short"
    wait_until(
        lambda: getattr(robot.status().preview.live_camera, "name", "") == "rear", "the fallback is live"
    )
    robot.enable_preview(camera="front")
    fault = next(each for each in robot.status().faults if each.id == "preview.camera.short")
    assert "camera short does not work" in fault.message
    assert "short" in fault.message
    live = []
    for item in robot.events(after=None):
        if isinstance(item, Event) and item.preview:
            live.append(item.preview.camera)
        elif isinstance(item, CaughtUp):
            break
    assert live[:4] == ["front", "rear", "short", "rear"]
    assert live[-1] == "front"
    assert robot.status().preview.counters.starts == 1


def test_the_choice_outlives_the_gateway_and_the_preview(ground: VideoGround) -> None:
    with GatewayClient(ground.target, PATIENT) as robot:
        robot.enable_preview(camera="rear")
    ground.gateway.kill()
    ground.start_gateway()
    with GatewayClient(ground.target, PATIENT) as robot:
        wait_until(lambda: robot.status().preview.wanted_camera == "rear", "the gateway has taken it over")
        ground.kill_preview()
        ground.preview.start_again()

        def rear_is_live() -> bool:
            rear = robot.status().preview.camera("rear")
            return rear is not None and rear.state is CameraState.LIVE

        wait_until(rear_is_live, "the gateway has applied it again")
