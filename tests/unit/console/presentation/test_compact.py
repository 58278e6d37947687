"""The compact density of the status table: what the side panel of a window shows."""

from dataclasses import replace

import pytest

from console.client.mapping.methods import GET_OVERLAY_SNAPSHOT
from console.presentation.severity_style import SeverityStyle
from console.presentation.status_row import Row, View
from console.presentation.status_table import table_rows
from omniseer.gateway.v1 import overlay_pb2, pose_pb2, source_pb2, value_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.gateway_double import healthy_status


@pytest.fixture
def message() -> overlay_pb2.OverlaySnapshot:
    return overlay_pb2.OverlaySnapshot(status=healthy_status())


def view(message: overlay_pb2.OverlaySnapshot) -> View:
    snapshot = GET_OVERLAY_SNAPSHOT.decode(message.SerializeToString())
    return View(snapshot.status, compact=True, detections=snapshot.detections)


def by_label(view: View) -> dict[str, Row]:
    return {row.label: row for row in table_rows(view)}


def test_a_healthy_robot(message: overlay_pb2.OverlaySnapshot) -> None:
    rows = by_label(view(message))
    assert list(rows) == ["Motion", "Vision", "Objects", "Battery"]
    assert rows["Motion"] == Row(
        "Motion", "fresh", SeverityStyle.GOOD, "0.50\u00a0m/s, turning\u00a0+0.30\u00a0rad/s", ""
    ), "no age in milliseconds while all is well"
    assert rows["Vision"].text == "29.5\u00a0fps, inference\u00a012.5\u00a0ms"
    assert rows["Battery"].text == "78\u00a0%"
    assert (rows["Objects"].mark, rows["Objects"].style) == ("no data", SeverityStyle.QUIET)


def test_ages_count_on_and_fresh_values_become_stale(message: overlay_pb2.OverlaySnapshot) -> None:
    later = replace(view(message), silent_ms=1988)
    assert (by_label(later)["Motion"].mark, by_label(later)["Motion"].age) == ("fresh", "2.0 s")
    outdated = by_label(replace(later, outdated=True))
    assert {row.mark for row in outdated.values()} == {"STALE", "no data"}
    assert outdated["Motion"].style is SeverityStyle.WARNING


def test_a_source_that_can_never_come_has_a_row(message: overlay_pb2.OverlaySnapshot) -> None:
    for name, state in (
        ("odometry", source_pb2.SOURCE_STATE_QOS_MISMATCH),
        ("mux_input", source_pb2.SOURCE_STATE_SILENT),
    ):
        message.status.sources.add(name=name, state=state, required=True, detail=f"{name}: because")
    rows = by_label(view(message))
    assert rows["Odometry"] == Row("Odometry", "no data", SeverityStyle.WARNING, "odometry: because", "")
    assert "Mux input" not in rows
    assert "Objects" not in rows, "this robot has no detections configured"


def test_how_the_robot_is_set_up(message: overlay_pb2.OverlaySnapshot) -> None:
    message.status.insecure = True
    message.status.teleop.state = states.TELEOP_ENABLED
    message.status.teleop.enabled = True
    message.status.teleop.max_linear_mps = 0.5
    message.status.gateway.boot_id, message.status.gateway.uptime_ms = "a", 90_000
    message.status.gateway.client_count = 2
    rows = by_label(view(message))
    assert (rows["Access"].mark, rows["Access"].style) == ("OPEN", SeverityStyle.WARNING)
    assert (rows["Teleop"].mark, rows["Teleop"].style) == ("ENABLED", SeverityStyle.GOOD)
    assert (rows["Gateway"].text, rows["Gateway"].age) == ("2 clients", "1 min 30 s")
    assert "Gateway" not in by_label(replace(view(message), outdated=True)), "it may not be up any more"


def test_a_row_never_breaks_between_a_number_and_its_unit(message: overlay_pb2.OverlaySnapshot) -> None:
    compute = message.status.platform.compute
    compute.available, compute.cpu_percent, compute.ram_used_percent = True, 34, 41
    compute.cpu_temperature_available, compute.cpu_temperature_c = True, 51
    compute.thermal_throttled_available = compute.thermal_throttled = True
    text = by_label(view(message))["Computer"].text
    assert text.replace("\u00a0", " ") == "CPU 34 %, 51 °C, throttled by heat, memory 41 %"
    assert all("," in part for part in text.split(" ")[:-1])


def test_numbers_of_the_configuration(message: overlay_pb2.OverlaySnapshot) -> None:
    add = message.status.numbers.add
    add(title="CO2", available=True, value=412.256, unit="ppm", decimals=1, level=value_pb2.NUMBER_LEVEL_GOOD)
    add(title="cell 3", available=True, value=3.1, level=value_pb2.NUMBER_LEVEL_ERROR_LOW)
    add(title="load", available=True, level=value_pb2.NUMBER_LEVEL_WARNING_HIGH)
    add(title="old", available=True, stale=True, age_ms=9000, value=1, level=value_pb2.NUMBER_LEVEL_GOOD)
    add(title="never", unit="m")
    rows = by_label(view(message))
    assert rows["CO2"] == Row("CO2", "fresh", SeverityStyle.GOOD, "412.3\u00a0ppm")
    assert rows["Cell 3"] == Row("Cell 3", "TOO LOW", SeverityStyle.BAD, "3.1")
    assert rows["Load"] == Row("Load", "UNKNOWN", SeverityStyle.WARNING, "-")
    assert rows["Old"] == Row("Old", "STALE", SeverityStyle.WARNING, "1", "9.0 s")
    assert rows["Never"] == Row("Never", "no data", SeverityStyle.QUIET, "")
    assert [row.label for row in table_rows(replace(view(message), compact=False))].count("cell 3") == 1


def test_texts_of_the_configuration(message: overlay_pb2.OverlaySnapshot) -> None:
    add = message.status.texts.add
    add(title="gripper", available=True, text="holds a bottle, firmly", level=value_pb2.TEXT_LEVEL_GOOD)
    add(title="arm", available=True, text="jammed", level=value_pb2.TEXT_LEVEL_ERROR)
    add(title="lamp", available=True, text="", level=value_pb2.TEXT_LEVEL_WARNING)
    add(title="list", available=True)
    rows = by_label(view(message))
    assert rows["Gripper"] == Row("Gripper", "fresh", SeverityStyle.GOOD, "holds a bottle, firmly")
    assert rows["Arm"] == Row("Arm", "ERROR", SeverityStyle.BAD, "jammed")
    assert (rows["Lamp"].mark, rows["Lamp"].text) == ("WARNING", "")
    assert rows["List"] == Row("List", "UNKNOWN", SeverityStyle.WARNING, "-")


def test_position_and_attitude(message: overlay_pb2.OverlaySnapshot) -> None:
    assert not {"Position", "Attitude"} & set(by_label(view(message))), "this robot reports neither"
    status = message.status
    status.position.available = status.orientation.available = True
    rows = by_label(view(message))
    assert (rows["Position"].mark, rows["Position"].text) == ("NO FIX", "-")
    assert (rows["Attitude"].mark, rows["Attitude"].text) == ("UNKNOWN", "-")
    position, attitude = status.position, status.orientation
    position.latitude_deg, position.longitude_deg, position.horizontal_accuracy_m = 48.1234567, -11.5, 1.5
    attitude.roll_deg, attitude.pitch_deg, attitude.yaw_deg = 1.5, -2.5, 170
    position.fix, position.altitude_m = pose_pb2.FIX_STATUS_GBAS, 520
    rows = by_label(view(message))
    assert rows["Position"].text == "48.123457°, -11.500000°, ±\u00a01.5\u00a0m"
    assert rows["Attitude"].text == "roll\u00a0+1.5°, pitch\u00a0-2.5°, yaw\u00a0+170.0°"
    full = by_label(replace(view(message), compact=False))
    assert full["position"].text == "48.123457°, -11.500000°, ± 1.5 m, altitude 520.0 m, GBAS"
