"""The robot of docs/configuration.md with two USB cameras and a ROS topic, set up by that page alone.

Its configuration is the page's, word by word, but for the folder of the device names: the cameras are doubles
of v4l2src, and any character devices stand for their nodes. The tap, the topic and all programs are real.
"""

import json
from functools import partial
from pathlib import Path

import pytest
import yaml

from tests.support.colour_eye import Eye
from tests.support.documented_configuration import THREE_CAMERAS, documented
from tests.support.robotctl import robotctl, robotctl_process
from tests.support.ros_camera import picture, ros_camera
from tests.support.running_tap import RunningTap
from tests.support.video_ground import VideoGround, video_ground
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.gst]

NODES = ("/dev/null", "/dev/zero")
# As many USB cameras send it.
MJPEG = "image/jpeg,width=320,height=240,framerate=30/1"
COLOURS = {"front": "red", "rear": "blue", "arm": "green"}


def states(ground: VideoGround) -> dict[str, str]:
    """What `robotctl status` lists."""
    listed = json.loads(robotctl("--target", ground.target, "--json", "status").stdout)["preview"]["cameras"]
    return {camera["name"]: camera["state"] for camera in listed}


def lists_as_live(ground: VideoGround, name: str) -> bool:
    return states(ground) == dict.fromkeys(COLOURS, "ready") | {name: "live"}


def test_all_three_are_shown_with_the_commands_of_the_page(tap: RunningTap, tmp_path: Path) -> None:
    folder = tmp_path / "by-path"
    folder.mkdir()
    text = documented("cameras", THREE_CAMERAS)
    assert text.count("/dev/v4l/by-path/") == len(NODES)
    cameras = yaml.safe_load(text.replace("/dev/v4l/by-path", str(folder)))["cameras"]
    assert list(cameras) == list(COLOURS)
    usb = {camera["device"]: COLOURS[name] for name, camera in cameras.items() if camera["kind"] == "v4l2"}
    for device, node in zip(usb, NODES, strict=True):
        Path(device).symlink_to(node)
    doubles = {device: {"modes": [[MJPEG, colour]], "fault": ""} for device, colour in usb.items()}
    settings = {"cameras": cameras, "camera_tap": {"socket": str(tap.socket)}}
    with (
        ros_camera(cameras["arm"]["topic"], picture("green"), hz=15.0),
        video_ground(tmp_path, settings, cameras=doubles) as ground,
    ):
        wait_until(lambda: states(ground) == dict.fromkeys(COLOURS, "ready"), "all cameras are ready")
        started = robotctl_process("--target", ground.target, "preview", "on")
        assert started.returncode == 0, started.stderr
        with Eye(ground.preview.port) as eye:
            eye.sees("red")
            for name in ("rear", "arm", "front"):
                chosen = robotctl("--target", ground.target, "preview", "on", "--camera", name)
                assert chosen.returncode == 0, chosen.stderr
                eye.sees(COLOURS[name])
                # A viewer may see it before the gateway has heard of it.
                wait_until(partial(lists_as_live, ground, name), f"{name} is live")
            assert eye.lost == [], "one SRT connection for all"
