"""The values of a robot's configuration in its state: bounded, without noise, the bad ones always there."""

from collections.abc import Callable

import pytest

from bridge.connection.configured_values import MOST_NUMBERS, MOST_TEXTS
from bridge.connection.robot_state import Own, robot_state, same_but_for_time
from fleet.reading import LARGEST_STATE
from omniseer.gateway.v1 import pose_pb2, value_pb2
from omniseer.gateway.v1.system_status_pb2 import SystemStatus
from tests.support.filled import fill_distinctly

OWN = Own(
    robot="lab2",
    bridge_version="1",
    gateway_target="",
    gateway_reachable=True,
    outbox_events=0,
    events_dropped=0,
)


def number(label: str = "motor", **changes: object) -> value_pb2.NumberStatus:
    made = value_pb2.NumberStatus(
        label=label,
        title=label.capitalize(),
        available=True,
        age_ms=40,
        value=61.25,
        unit="°C",
        decimals=1,
        level=value_pb2.NUMBER_LEVEL_GOOD,
        error_above=90,
        tile=True,
    )
    made.MergeFrom(value_pb2.NumberStatus(**changes))  # type: ignore[arg-type]
    return made


def status() -> SystemStatus:
    made = SystemStatus()
    made.numbers.append(number())
    made.texts.add(
        label="gripper",
        title="Gripper",
        available=True,
        text="open",
        level=value_pb2.TEXT_LEVEL_GOOD,
        tile=True,
    )
    made.position.CopyFrom(
        pose_pb2.PositionStatus(
            available=True, fix=pose_pb2.FIX_STATUS_FIX, latitude_deg=47.12345678, longitude_deg=8.5
        )
    )
    made.orientation.CopyFrom(
        pose_pb2.OrientationStatus(available=True, roll_deg=1.26, pitch_deg=0, yaw_deg=-90.04)
    )
    return made


def test_every_kind_of_value_is_in_the_state() -> None:
    state = robot_state(OWN, status())
    (motor,), (gripper,) = state.numbers, state.texts
    assert (motor.label, motor.title, motor.value, motor.unit, motor.decimals) == (
        "motor", "Motor", 61.25, "°C", 1,
    )  # fmt: skip
    assert (motor.available, motor.stale, motor.age_ms) == (True, False, 40)
    assert motor.tile
    assert gripper.tile
    # Limits are the robot's own matter: what follows from them is the level.
    assert not motor.HasField("error_above")
    assert (gripper.label, gripper.title, gripper.text) == ("gripper", "Gripper", "open")
    assert (state.position.latitude_deg, state.position.longitude_deg) == (47.123457, 8.5)
    assert state.position.fix == pose_pb2.FIX_STATUS_FIX
    assert state.orientation.roll_deg == pytest.approx(1.3)
    assert state.orientation.yaw_deg == pytest.approx(-90.0)
    assert state.values_left_out == 0


def test_a_robot_without_such_sources_has_none() -> None:
    state = robot_state(OWN, SystemStatus())
    assert not state.numbers
    assert not state.texts
    assert not state.HasField("position")
    assert not state.HasField("orientation")


def noise(changed: SystemStatus) -> None:
    changed.numbers[0].value += 3
    changed.numbers[0].age_ms = 900
    changed.texts[0].age_ms = 900
    changed.position.latitude_deg += 1
    changed.position.horizontal_accuracy_m = 0
    changed.position.age_ms = changed.orientation.age_ms = 77
    changed.orientation.yaw_deg = 12


def test_what_is_measured_alone_is_no_change() -> None:
    now, later = status(), status()
    now.position.horizontal_accuracy_m = 5
    noise(later)
    before, after = robot_state(OWN, now), robot_state(OWN, later)
    assert before != after
    assert same_but_for_time(before) == same_but_for_time(after)
    # What is sent is not touched by the comparison.
    assert after.numbers[0].value == 64.25


@pytest.mark.parametrize(
    "change",
    [
        lambda it: setattr(it.numbers[0], "level", value_pb2.NUMBER_LEVEL_ERROR_HIGH),
        lambda it: setattr(it.numbers[0], "stale", True),
        lambda it: it.numbers[0].ClearField("value"),
        lambda it: it.numbers.pop(),
        lambda it: setattr(it.texts[0], "text", "closed"),
        lambda it: setattr(it.texts[0], "level", value_pb2.TEXT_LEVEL_ERROR),
        lambda it: setattr(it.texts[0], "stale", True),
        lambda it: setattr(it.position, "fix", pose_pb2.FIX_STATUS_NONE),
        lambda it: it.position.ClearField("latitude_deg"),
        lambda it: setattr(it.position, "stale", True),
        lambda it: it.orientation.ClearField("roll_deg"),
        lambda it: it.ClearField("orientation"),
    ],
)
def test_what_has_happened_is_a_change(change: Callable[[SystemStatus], None]) -> None:
    changed = status()
    change(changed)
    assert same_but_for_time(robot_state(OWN, status())) != same_but_for_time(robot_state(OWN, changed))


def test_of_too_many_the_worst_stay_in_their_order() -> None:
    made = SystemStatus()
    made.numbers.extend(number(f"n{index}") for index in range(40))
    made.numbers[30].level = value_pb2.NUMBER_LEVEL_WARNING_LOW
    made.numbers[39].level = value_pb2.NUMBER_LEVEL_ERROR_HIGH
    for index in range(20):
        made.texts.add(label=f"t{index}", level=value_pb2.TEXT_LEVEL_GOOD)
    made.texts[19].level = value_pb2.TEXT_LEVEL_ERROR
    state = robot_state(OWN, made)
    assert [each.label for each in state.numbers] == [*(f"n{index}" for index in range(14)), "n30", "n39"]
    assert [each.label for each in state.texts] == [*(f"t{index}" for index in range(15)), "t19"]
    assert state.values_left_out == 60 - MOST_NUMBERS - MOST_TEXTS


def test_what_is_no_finite_number_does_not_break_the_state() -> None:
    made = status()
    made.numbers[0].value = float("nan")
    made.position.latitude_deg, made.position.longitude_deg = float("inf"), float("nan")
    made.orientation.roll_deg = float("-inf")
    state = robot_state(OWN, made)
    assert not state.position.HasField("latitude_deg")
    assert not state.orientation.HasField("roll_deg")
    # NaN is not equal to itself: as a change it would be sent at every look.
    assert same_but_for_time(state) == same_but_for_time(robot_state(OWN, made))


def test_a_state_with_giant_values_fits() -> None:
    made = SystemStatus()
    fill_distinctly(made)
    for index in range(64):
        made.numbers.append(number(f"n{index}", title="x" * 5000, unit="y" * 5000))
        made.texts.add(label="z" * 5000, title="ü" * 5000, text="€" * 5000)
    assert robot_state(OWN, made).ByteSize() < LARGEST_STATE / 3
