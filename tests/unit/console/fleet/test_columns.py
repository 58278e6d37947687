"""The cells of the fleet's table: bounded, and never saying more than is known."""

import pytest

from console.client.results import HealthState
from console.fleet.columns import COLUMNS, STANDING_STYLES, Cell, columns_for, shortened, summary_line
from console.fleet.model import FleetSummary, ReportedState, fleet_rows
from console.fleet.values import Enrolment, FleetRow
from console.fleet.wire import state_of
from console.presentation.severity_style import SeverityStyle
from fleet.standing import Standing
from omniseer.fleet.v1.state_pb2 import RobotState
from omniseer.gateway.v1 import fault_pb2, recording_pb2, value_pb2
from tests.support.filled import fill
from tests.support.fleet_values import healthy_state

NOW = 2_000_000_000_000
COLUMN = {column.title: column for column in COLUMNS}


def row_of(message: RobotState, *, age_ms: int = 0) -> FleetRow:
    state = ReportedState(state_of(message.robot, message.SerializeToString()), NOW - age_ms)
    (row,) = fleet_rows({message.robot: Enrolment(message.robot)}, {message.robot: state}, NOW)
    return row


def test_every_standing_has_a_style() -> None:
    assert STANDING_STYLES.keys() == set(Standing)


def test_a_healthy_robot() -> None:
    row = row_of(healthy_state("a"))
    shown = {title: column.cell(row).text for title, column in COLUMN.items()}
    assert shown == {
        "robot": "a",
        "": "UP",
        "since": "2 h 01 min",
        "health": "robot healthy",
        "battery": "78 %",
        "disk": "40 %",
        "mode": "idle",
        "values": "-",
        "uploads": "-",
        "outbox": "-",
        "seen": "0 ms",
    }


def test_a_robot_that_was_never_seen() -> None:
    (row,) = fleet_rows({"a": Enrolment("a")}, {}, NOW)
    assert {column.cell(row).text for column in COLUMNS[2:]} == {"-"}


def test_the_worst_fault_and_the_number_of_others() -> None:
    message = healthy_state("a")
    message.faults.add(severity=fault_pb2.FAULT_SEVERITY_ERROR, message="lidar silent")
    message.fault_count = 3
    assert COLUMN["health"].cell(row_of(message)) == Cell("error: lidar silent (+2)", SeverityStyle.BAD)


def test_low_values_are_marked_by_a_word() -> None:
    message = healthy_state("a")
    message.battery_percent, message.charging, message.disk_used_percent = 8, True, 99
    assert COLUMN["battery"].cell(row_of(message)) == Cell("8 % +, LOW", SeverityStyle.BAD)
    assert COLUMN["disk"].cell(row_of(message)) == Cell("99 %, FULL", SeverityStyle.BAD)


def test_a_part_is_at_least_as_bad_as_its_own_fault() -> None:
    """By limits of the robot's own: both values are good by the usual ones."""
    message = healthy_state("a")
    message.battery_percent, message.disk_used_percent = 60, 40
    message.faults.add(fault_id="battery.low", severity=fault_pb2.FAULT_SEVERITY_WARNING)
    message.faults.add(fault_id="platform.disk", severity=fault_pb2.FAULT_SEVERITY_ERROR)
    assert COLUMN["battery"].cell(row_of(message)) == Cell("60 %, LOW", SeverityStyle.WARNING)
    assert COLUMN["disk"].cell(row_of(message)) == Cell("40 %, FULL", SeverityStyle.BAD)


def test_the_last_known_state_of_a_robot_that_is_away_is_quiet() -> None:
    message = healthy_state("a")
    message.battery_percent = 8
    row = row_of(message, age_ms=60_000)
    assert COLUMN["battery"].cell(row) == Cell("8 %, LOW", SeverityStyle.QUIET)
    assert COLUMN["health"].cell(row).style is SeverityStyle.QUIET
    assert COLUMN[""].cell(row) == Cell("AWAY", SeverityStyle.WARNING)


@pytest.mark.parametrize(
    ("state", "text", "style"),
    [
        (recording_pb2.RECORDING_COPY_STATE_UPLOADING, "uploading 25 % 2.0 MB/s (+1)", SeverityStyle.GOOD),
        (recording_pb2.RECORDING_COPY_STATE_FAILED, "failed 25 % 2.0 MB/s (+1)", SeverityStyle.WARNING),
    ],
)
def test_an_upload(
    state: "recording_pb2.RecordingCopyState.ValueType", text: str, style: SeverityStyle
) -> None:
    message = healthy_state("a")
    message.uploads.add(
        size=8000, bytes_per_s=2_000_000, copy=recording_pb2.RecordingCopy(state=state, bytes_done=2000)
    )
    message.upload_count = 2
    assert COLUMN["uploads"].cell(row_of(message)) == Cell(text, style)


def test_the_worst_values_come_first() -> None:
    message = healthy_state("a")
    message.numbers.add(label="cell", title="Cell", available=True, value=3.9, unit="V", decimals=2)
    message.numbers.add(label="wheel", title="Wheel", available=True, stale=True, value=2)
    message.numbers.add(label="never", title="Never")
    message.texts.add(
        label="arm", title="Arm", available=True, text="jammed", level=value_pb2.TEXT_LEVEL_ERROR
    )
    message.values_left_out = 3
    assert COLUMN["values"].cell(row_of(message)) == Cell(
        "Arm jammed ERROR, Wheel 2 STALE, Cell 3.90 V, Never ... (+3)", SeverityStyle.BAD
    )
    del message.numbers[1:], message.texts[:]
    message.values_left_out = 0
    assert COLUMN["values"].cell(row_of(message)) == Cell("Cell 3.90 V")
    assert COLUMN["values"].cell(row_of(message, age_ms=60_000)).style is SeverityStyle.QUIET


def test_events_that_wait_or_were_dropped() -> None:
    message = healthy_state("a")
    message.outbox_events, message.events_dropped = 12, 3
    assert COLUMN["outbox"].cell(row_of(message)) == Cell("12, 3 dropped", SeverityStyle.WARNING)


def test_percentages_that_are_none() -> None:
    message = healthy_state("a")
    message.battery_percent = message.disk_used_percent = 2**32 - 1
    assert COLUMN["battery"].cell(row_of(message)).text == "-"
    assert COLUMN["disk"].cell(row_of(message)).text == "-"


def test_no_cell_of_a_giant_state_is_long() -> None:
    message = healthy_state("a")
    fill(message)
    message.robot = "a"
    message.summary = message.mode = message.faults[0].message = "x" * 5000
    message.fault_count = message.upload_count = 2**32 - 1
    message.gateway_uptime_s = message.outbox_events = message.events_dropped = 2**64 - 1
    message.numbers[0].title = message.texts[0].text = "x" * 5000
    message.values_left_out = 2**32 - 1
    message.uploads[0].size = message.uploads[0].bytes_per_s = 2**64 - 1
    row = row_of(message)
    assert row.state
    assert row.state.health is not HealthState.UNKNOWN
    assert all(len(column.cell(row).text) <= 80 for column in COLUMNS)


def test_a_narrow_terminal_gets_the_columns_that_matter_most() -> None:
    titles = [column.title for column in columns_for(90)]
    assert titles == ["robot", "", "since", "health", "battery", "seen"]
    titles = [column.title for column in columns_for(120)]
    assert titles == ["robot", "", "since", "health", "battery", "disk", "uploads", "seen"]
    titles = [column.title for column in columns_for(170)]
    assert titles == [column.title for column in COLUMNS if column.title != "values"]
    assert [column.title for column in columns_for(220)] == [column.title for column in COLUMNS]


@pytest.mark.parametrize(("width", "health"), [(80, 20), (120, 21), (170, 49), (300, 60)])
def test_the_health_gets_what_is_left(width: int, health: int) -> None:
    (column,) = (column for column in columns_for(width) if column.title == "health")
    assert column.width == health


def test_the_line_below_has_only_what_there_is() -> None:
    calm = FleetSummary(2, 2, 0, 0, 0, 0, 0, 0)
    assert summary_line(calm) == "2 of 2 robots up"
    loud = FleetSummary(9, 3, 2, 1, 1, 4, 7, 1)
    assert summary_line(loud) == (
        "3 of 9 robots up, 2 silent, 1 with errors, 1 with warnings, 4 uploads, 7 events waiting, "
        "1 event dropped"
    )


def test_shortened() -> None:
    assert shortened("abcdef", 6) == "abcdef"
    assert shortened("abcdefg", 6) == "abc..."
