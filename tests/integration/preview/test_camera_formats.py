"""Cameras at V4L2 devices: which of their formats are shown, and what becomes of those that fail.

The camera is a double with the name, the properties and the failures of v4l2src. Each of its formats has a
colour of its own.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from omniseer.preview.v1 import preview_service_pb2 as pb
from tests.support.colour_eye import Eye
from tests.support.running_preview import OF_A_SILENT_SOURCE, RunningPreview

pytestmark = pytest.mark.gst

# Any character device will do: the double stands before it.
FRONT, REAR = "/dev/null", "/dev/zero"


def raw(colour: str, width: int, height: int, fps: int) -> list[str]:
    return [f"video/x-raw,format=YUY2,width={width},height={height},framerate={fps}/1", colour]


def jpeg(colour: str, width: int, height: int, fps: int) -> list[str]:
    return [f"image/jpeg,width={width},height={height},framerate={fps}/1", colour]


def source(device: str = FRONT, **more: Any) -> dict[str, Any]:
    return {"source": {"kind": "v4l2", "device": device, **more}}


def offering(*modes: Sequence[str], fault: str = "") -> dict[str, Any]:
    return {"modes": [list(mode) for mode in modes], "fault": fault}


@contextmanager
def shown(tmp_path: Path, settings: dict[str, Any], **cameras: Any) -> Iterator[tuple[RunningPreview, Eye]]:
    """A service that shows a camera, and a viewer."""
    devices = {{"front": FRONT, "rear": REAR}[name]: camera for name, camera in cameras.items()}
    with RunningPreview(tmp_path, settings, cameras=devices) as preview:
        preview.enable()
        preview.running()
        with Eye(preview.port) as eye:
            yield preview, eye


@pytest.mark.parametrize(
    ("offered", "colour"),
    [
        pytest.param([jpeg("blue", 640, 480, 30)], "blue", id="JPEG alone"),
        pytest.param([raw("red", 640, 480, 30)], "red", id="raw alone"),
        pytest.param(
            [raw("red", 320, 240, 10), jpeg("blue", 320, 240, 30)], "blue", id="raw is slower, as over USB 2"
        ),
        pytest.param([raw("red", 320, 240, 30), jpeg("blue", 640, 480, 30)], "red", id="raw is as fast"),
        pytest.param(
            [raw("red", 160, 120, 30), jpeg("blue", 320, 240, 30), jpeg("green", 1280, 960, 30)],
            "blue",
            id="no larger than needed",
        ),
        pytest.param([jpeg("green", 1280, 960, 30)], "green", id="larger ones where there are no others"),
    ],
)
def test_the_format_is_chosen_by_rate_and_size(tmp_path: Path, offered: list[list[str]], colour: str) -> None:
    with shown(tmp_path, source(), front=offering(*offered)) as (preview, eye):
        eye.sees(colour)
        eye.more_frames(10)
        assert eye.colours(2) == {colour}
        assert preview.running().counters == pb.Counters(starts=1)


@pytest.mark.parametrize(("form", "colour"), [("raw", "red"), ("jpeg", "blue")])
def test_the_format_may_be_configured(tmp_path: Path, form: str, colour: str) -> None:
    offered = offering(raw("red", 320, 240, 30), jpeg("blue", 320, 240, 30))
    with shown(tmp_path, source(format=form), front=offered) as (_preview, eye):
        eye.sees(colour)


def test_a_profile_of_another_rate_and_size_keeps_the_format(tmp_path: Path) -> None:
    offered = offering(raw("red", 320, 240, 10), jpeg("blue", 320, 240, 30))
    with shown(tmp_path, source(), front=offered) as (preview, eye):
        eye.sees("blue")
        preview.enable(pb.PROFILE_LOW_BW)
        preview.wait_for(lambda a: 12 < a.measurement.fps < 18, "the profile's rate")
        eye.sees("blue")
        assert eye.lost == []


def test_a_camera_without_the_configured_format_is_explained(tmp_path: Path) -> None:
    cameras = {FRONT: offering(jpeg("blue", 320, 240, 30))}
    with RunningPreview(tmp_path, source(format="raw"), cameras=cameras) as preview:
        preview.enable()
        state = preview.faulted("not-negotiated")
        assert f"camera {FRONT}" in state.last_error
        assert "'format: auto' takes whatever it offers" in state.last_error
        assert state.counters.fallbacks == 0


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("closed", "Cannot identify device"),
        ("busy", "is busy"),
        ("unplugged:20", "Could not read from resource (poll error 1: No such device (19))"),
        ("silent:20", "has sent no frame for"),
    ],
)
@pytest.mark.parametrize("mode", [raw, jpeg])
def test_a_camera_that_fails_is_a_fault_of_the_source(
    tmp_path: Path, mode: Any, fault: str, words: str
) -> None:
    cameras = {FRONT: offering(mode("red", 320, 240, 30), fault=fault)}
    with RunningPreview(tmp_path, source() | OF_A_SILENT_SOURCE, cameras=cameras) as preview:
        preview.enable()
        state = preview.faulted(words)
        assert state.counters.fallbacks == 0, "no encoder is blamed"
        preview.disable()
        preview.disabled()


def test_cameras_of_different_formats_take_each_others_place(tmp_path: Path) -> None:
    settings = {
        "cameras": {
            "front": {"kind": "v4l2", "device": FRONT, "fallback": "rear"},
            "rear": {"kind": "v4l2", "device": REAR},
        }
    }
    front = offering(jpeg("blue", 640, 480, 30))
    with shown(tmp_path, settings, front=front, rear=offering(raw("red", 320, 240, 30))) as (preview, eye):
        eye.sees("blue")
        for camera, colour in (("rear", "red"), ("front", "blue")):
            preview.revision += 1
            preview.apply(
                pb.DesiredState(
                    revision=preview.revision, enabled=True, profile=pb.PROFILE_BALANCED, camera=camera
                )
            )
            eye.sees(colour)
        assert eye.lost == []
        assert preview.running().counters == pb.Counters(starts=1)
