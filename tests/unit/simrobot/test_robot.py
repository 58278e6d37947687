from typing import Any

import pytest

from common.errors import UserError
from simrobot.behaviour import Behaviour, Topic
from simrobot.robot import Robot


def robot(**behaviour: Any) -> Robot:
    return Robot(Behaviour().changed(behaviour), now_s=100.0)


def test_the_battery_drains_and_stops_at_empty() -> None:
    running = robot(battery_percent=10, battery_drain_percent_per_s=1)
    assert running.battery_percent(104.0) == 6.0
    assert running.battery_percent(500.0) == 0.0


def test_a_change_of_something_else_does_not_refill_the_battery() -> None:
    running = robot(battery_percent=10, battery_drain_percent_per_s=1)
    running.change({"speed_mps": 1.0}, now_s=104.0)
    assert running.battery_percent(105.0) == 5.0


def test_a_battery_can_be_charged() -> None:
    running = robot(battery_percent=99, battery_drain_percent_per_s=-1)
    assert running.battery_percent(200.0) == 100.0


def test_inference_errors_are_counted_while_they_happen_and_never_forgotten() -> None:
    running = robot(infer_errors_per_s=2)
    assert running.vision_counts(105.0, 30).infer_errors == 10
    running.change({"infer_errors_per_s": 0}, now_s=105.0)
    assert running.vision_counts(200.0, 30).infer_errors == 10


def test_a_change_of_speed_does_not_move_what_was_driven_before() -> None:
    running = robot(speed_mps=1.0, turn_rad_s=0.0)
    running.change({"speed_mps": 0.0}, now_s=102.0)
    running.advance(110.0)
    assert running.pose.x_m == pytest.approx(2.0)


def test_topics_are_silenced_by_name() -> None:
    assert robot(silent=["odometry"]).behaviour.silent == {Topic.ODOMETRY}


def test_a_mode_change_is_reported_once() -> None:
    running = robot(mode="idle")
    assert running.mode_changed()
    assert not running.mode_changed()
    running.change({"mode": "returning"}, now_s=101.0)
    assert running.mode_changed()


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"speed": 1}, "speed"),
        ({"battery_percent": 101}, "battery_percent"),
        ({"silent": ["sonar"]}, "silent"),
        ({"speed_mps": "fast"}, "speed_mps"),
        ({"detection_count": -1}, "detection_count"),
        ({"commander": "ghost"}, "commander"),
        ({"components": {"drive": "broken"}}, "components"),
    ],
)
def test_an_invalid_request_changes_nothing(fields: dict[str, Any], named: str) -> None:
    running = robot()
    before = running.behaviour
    with pytest.raises(UserError, match=named):
        running.change(fields, now_s=100.0)
    assert running.behaviour == before
