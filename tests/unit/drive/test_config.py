"""Settings of the drive program: deadlines may be shortened and not prolonged, and nothing is infinite."""

import json
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from common.config import load
from common.errors import UserError
from drive.config import DriveSettings
from drive.motion.machine import OnLoss, Rules


def test_the_defaults_are_those_of_the_machine() -> None:
    assert DriveSettings().rules == Rules()


@pytest.mark.parametrize(
    "values",
    [
        {"deadlines": {"command_ms": 251}},
        {"deadlines": {"unary_ms": 501}},
        {"deadlines": {"loop_ms": 401}},
        {"deadlines": {"picture_ms": 601}},
        {"deadlines": {"command_ms": 0}},
        {"limits": {"vx_mps": float("nan")}},
        {"limits": {"vx_mps": float("inf")}},
        {"limits": {"wheel_mps": float("nan")}},
        {"limits": {"acceleration_mps2": 0}},
        {"limits": {"release_ramp_s": 0.6}},
        {"outputs": []},
        {"outputs": [{"topic": "cmd_vel"}]},
        {"outputs": [{"topic": "/cmd vel"}]},
        {"outputs": [{"type": "std_msgs/msg/String"}]},
        {"on_loss": "go on"},
        {"wings": 2},
    ],
)
def test_what_is_refused(values: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        DriveSettings(**values)


def test_what_a_robot_without_a_mux_sets() -> None:
    values: dict[str, Any] = {
        "outputs": [{"topic": "/cmd_vel", "type": "geometry_msgs/msg/Twist"}],
        "mux_output": None,
        "lock_topic": None,
        "odometry": None,
        "limits": {"vy_mps": 0, "wheel_mps": 0},
        "on_loss": "hand_back",
        "deadlines": {"command_ms": 100},
    }
    rules = DriveSettings(**values).rules
    assert rules.on_loss is OnLoss.HAND_BACK
    assert rules.limits.wheel_mps == 0
    assert rules.deadlines.command_ns == 100_000_000


def test_the_lock_is_no_stop_of_the_robots_own(tmp_path: Path) -> None:
    config = tmp_path / "drive.yaml"
    config.write_text(json.dumps({"stop_topics": ["/button", "/lock"], "lock_topic": "/lock"}))
    with pytest.raises(UserError, match="stop_topics lists /lock, which is lock_topic") as error:
        load(DriveSettings, config)
    assert error.value.remedy == "Give the stop button and the lock of robot-drive a topic each"
    config.write_text(json.dumps({"stop_topics": ["/button"], "lock_topic": None}))
    assert load(DriveSettings, config).lock_topic is None
