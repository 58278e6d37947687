"""The client library alone: the wheel in an empty environment, without GStreamer, Qt and ROS."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.gateway_double import GatewayDouble, serving

ROOT = Path(__file__).parents[2]
DONE_WITHIN_S = 240
EXAMPLE = """
import importlib.util, sys
from pathlib import Path
import console.client
from console.client import GatewayClient
assert Path(console.__file__).is_relative_to(sys.prefix), console.__file__
assert (Path(console.__file__).parent / "py.typed").exists()
for absent in ("gi", "PySide6", "rclpy", "uvloop", "prometheus_client"):
    assert importlib.util.find_spec(absent) is None, absent
with GatewayClient(sys.argv[1]) as robot:
    print(robot.status().health.summary)
"""


def run(*command: str | Path, check: bool = True) -> "subprocess.CompletedProcess[str]":
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    ended = subprocess.run(
        command, cwd="/", env=kept, capture_output=True, text=True, timeout=DONE_WITHIN_S, check=False
    )
    assert not check or ended.returncode == 0, ended.stderr
    return ended


@pytest.mark.timeout(DONE_WITHIN_S + 60)
def test_the_wheel_alone_talks_to_a_robot(tmp_path: Path) -> None:
    built = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    (wheel,) = tmp_path.glob("robot_gateway-*.whl")
    environment = tmp_path / "environment"
    run("/usr/bin/python3", "-m", "venv", "--without-pip", environment)
    # The locked versions, as scripts/setup has fetched them already.
    install = (
        ". scripts/package-index.sh && exec .cache/tools/bin/uv pip install --python"
        f" {environment}/bin/python -c requirements/dev.txt {wheel}"
    )
    run("bash", "-c", f"cd {ROOT} && {install}")
    python, robotctl = environment / "bin/python", environment / "bin/robotctl"
    with serving(GatewayDouble()) as port:
        target = f"127.0.0.1:{port}"
        assert run(python, "-c", EXAMPLE, target).stdout == "robot healthy\n"
        assert "robot healthy" in run(robotctl, "--target", target, "status").stdout
        video = run(robotctl, "--target", target, "view", "--headless", check=False)
    assert video.returncode == 1
    assert "video needs GStreamer" in video.stderr
