"""The detector's real messages: the other tests have the stand-in for yolo_msgs, which has fewer fields.

Nothing of the real package is part of this project (docs/dependencies.md). A checkout of yolo_ros is named:
`ROBOT_YOLO_ROS=DIR scripts/test tests/integration/gateway/ros/test_real_detections.py --on-request`.
"""

import json
import os
import subprocess
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[4]
CHECKOUT = "ROBOT_YOLO_ROS"
BUILT_WITHIN_S = 1500
READ_WITHIN_S = 120

pytestmark = [
    pytest.mark.on_request,
    pytest.mark.ros,
    pytest.mark.timeout(BUILT_WITHIN_S + 2 * READ_WITHIN_S),
    pytest.mark.skipif(CHECKOUT not in os.environ, reason=f"{CHECKOUT} names no checkout of yolo_ros"),
]


@pytest.fixture(scope="module")
def with_the_real_package(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, str]:
    """The environment of programs that find it before the stand-in."""
    directory = tmp_path_factory.mktemp("interfaces")
    prefix = directory / "prefix"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", prefix], check=True, timeout=60)
    places = {
        "prefix": str(prefix),
        "work": str(directory / "work"),
        "yolo_msgs": str(Path(os.environ[CHECKOUT]).resolve() / "yolo_msgs"),
    }
    built = subprocess.run(
        ["bash", "-c", ". scripts/package-index.sh && scripts/build-interfaces"],
        cwd=ROOT,
        env={**os.environ, **places},
        capture_output=True,
        text=True,
        timeout=BUILT_WITHIN_S,
        check=False,
    )
    assert built.returncode == 0, built.stderr[-3000:]
    modules = sysconfig.get_path("platlib", vars={"platbase": str(prefix)})
    first = {"PYTHONPATH": modules, "LD_LIBRARY_PATH": str(prefix / "lib")}
    return {
        name: os.pathsep.join([path, *filter(None, [os.environ.get(name)])]) for name, path in first.items()
    }


def test_objects_with_masks_and_key_points_are_read_whole(
    with_the_real_package: Mapping[str, str],
    ros_domain: int,  # noqa: ARG001  # for its effect
) -> None:
    """The second one, too, which lies behind the mask of the first; the third is counted."""
    read = subprocess.run(
        [sys.executable, "-m", "tests.support.real_detections"],
        cwd=ROOT,
        env={**os.environ, **with_the_real_package},
        capture_output=True,
        text=True,
        timeout=READ_WITHIN_S,
        check=False,
    )
    assert read.returncode == 0, read.stderr
    found = json.loads(read.stdout)
    assert found["count"] == 3
    person, car = found["items"]
    assert person == {
        "class_id": 0,
        "class_name": "person",
        "score": 0.875,
        "track_id": "7",
        "center_x_px": 640.0,
        "center_y_px": 360.0,
        "width_px": 100.0,
        "height_px": 250.0,
    }
    assert car == {
        "class_id": 2,
        "class_name": "car",
        "score": 0.5,
        "track_id": "",
        "center_x_px": 10.5,
        "center_y_px": 20.25,
        "width_px": 30.0,
        "height_px": 40.0,
    }


def test_the_program_would_notice_the_stand_in(ros_domain: int) -> None:  # noqa: ARG001  # for its effect
    read = subprocess.run(
        [sys.executable, "-m", "tests.support.real_detections"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=READ_WITHIN_S,
        check=False,
    )
    assert read.returncode != 0
    assert "KeyPoint2D" in read.stderr
