"""The rows of one robot: everything that its state has, bounded, and the last known marked as such."""

from console.fleet.details import detail_rows
from console.fleet.model import ReportedState, fleet_rows
from console.fleet.values import Enrolment, FleetRow
from console.fleet.wire import state_of
from console.presentation.severity_style import SeverityStyle
from console.presentation.status_row import Row
from omniseer.fleet.v1.state_pb2 import RobotState
from omniseer.gateway.v1 import fault_pb2, pose_pb2, value_pb2
from tests.support.filled import fill
from tests.support.fleet_values import healthy_state

NOW = 2_000_000_000_000


def row_of(message: RobotState, *, age_ms: int = 0) -> FleetRow:
    state = ReportedState(state_of(message.robot, message.SerializeToString()), NOW - age_ms)
    (row,) = fleet_rows({message.robot: Enrolment(message.robot)}, {message.robot: state}, NOW)
    return row


def with_values() -> RobotState:
    message = healthy_state("a")
    message.numbers.add(
        label="motor",
        title="Motor",
        available=True,
        value=91.25,
        unit="°C",
        decimals=1,
        level=value_pb2.NUMBER_LEVEL_ERROR_HIGH,
    )
    message.numbers.add(label="old", title="Old", available=True, stale=True, value=1, age_ms=5000)
    message.texts.add(
        label="gripper", title="Gripper", available=True, text="open", level=value_pb2.TEXT_LEVEL_GOOD
    )
    message.texts.add(label="arm", title="Arm")
    message.position.CopyFrom(
        pose_pb2.PositionStatus(
            available=True, fix=pose_pb2.FIX_STATUS_FIX, latitude_deg=47.5, longitude_deg=8.25
        )
    )
    message.orientation.CopyFrom(
        pose_pb2.OrientationStatus(available=True, roll_deg=1.5, pitch_deg=-2, yaw_deg=90)
    )
    message.values_left_out = 2
    return message


def rows(message: RobotState, *, age_ms: int = 0) -> dict[str, Row]:
    return {each.label or each.text: each for each in detail_rows(row_of(message, age_ms=age_ms))}


def test_every_kind_of_value_is_a_row() -> None:
    found = rows(with_values())
    assert (found["Motor"].mark, found["Motor"].text, found["Motor"].style) == (
        "TOO HIGH",
        "91.2 °C",
        SeverityStyle.BAD,
    )
    assert (found["Old"].mark, found["Old"].age) == ("STALE", "5.0 s")
    assert (found["Gripper"].mark, found["Gripper"].text) == ("fresh", "open")
    assert (found["Arm"].mark, found["Arm"].text) == ("no data", "")
    assert found["position"].text == "47.500000°, 8.250000°, FIX"
    assert found["attitude"].text == "roll +1.5°, pitch -2.0°, yaw +90.0°"
    assert "2 values that the state does not list" in found
    assert found["standing"].text == "for 2 h 01 min"


def test_values_of_a_robot_that_is_away_are_stale_and_as_old_as_they_are() -> None:
    found = rows(with_values(), age_ms=60_000)
    assert found["standing"].mark == "AWAY"
    assert (found["Motor"].mark, found["Motor"].age) == ("STALE", "1 min 00 s")
    assert (found["position"].mark, found["health"].style) == ("STALE", SeverityStyle.WARNING)
    assert found["health"].text == "last known: OK, robot healthy"


def test_a_robot_without_values_has_no_rows_of_them() -> None:
    found = rows(healthy_state("a"))
    assert set(found) == {"standing", "health", "battery", "disk", "mode", "software"}
    assert found["health"].style is SeverityStyle.GOOD


def test_all_faults_and_how_many_are_not_listed() -> None:
    message = healthy_state("a")
    message.faults.add(severity=fault_pb2.FAULT_SEVERITY_ERROR, message="lidar silent")
    message.fault_count = 3
    found = rows(message)
    assert (found["fault"].mark, found["fault"].text) == ("error", "lidar silent")
    assert (found["health"].mark, found["health"].style) == ("OK", SeverityStyle.WARNING), "not a green OK"
    assert "2 faults that the state does not list" in found


def test_a_robot_that_was_never_seen_has_its_standing_alone() -> None:
    (row,) = fleet_rows({"a": Enrolment("a")}, {}, NOW)
    assert [(each.label, each.mark) for each in detail_rows(row)] == [("standing", "NEVER SEEN")]


def test_every_row_of_a_giant_state_is_bounded() -> None:
    message = healthy_state("a")
    fill(message)
    message.robot = "a"
    for text in ("summary", "mode", "gateway_version", "bridge_version", "gateway_target"):
        setattr(message, text, "x" * 5000)
    message.faults[0].message = message.numbers[0].unit = message.numbers[0].title = "x" * 5000
    message.texts[0].text = message.texts[0].title = message.uploads[0].label = "x" * 5000
    message.numbers[0].value, message.numbers[0].decimals = 1e300, 2**32 - 1
    for each in detail_rows(row_of(message)):
        assert max(len(each.label), len(each.mark), len(each.text)) <= 200
