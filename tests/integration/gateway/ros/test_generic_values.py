"""Values that only the configuration names, from real publishers of several types to the operator's table."""

import json
import math
import re
import subprocess
import sys
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, JointState, Temperature
from std_msgs.msg import Bool, Byte, Float64MultiArray, String, UInt64

from common.findings import Verdict
from gateway.config import SourceSettings
from gateway.ros.doctor import ros_findings
from gateway.ros.field_types import FieldMissingError, check_field
from gateway.ros.intake import intake
from gateway.status.board import Board
from omniseer.gateway.v1 import source_pb2, value_pb2
from tests.support.free import free_tcp_port
from tests.support.gateway_program import GatewayProgram, gateway_program
from tests.support.robotctl import robotctl, robotctl_process
from tests.support.talker import Talker
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]


def number(label: str, message_type: str, field: str, **more: Any) -> dict[str, Any]:
    return {
        "kind": "number",
        "label": label,
        "topic": f"/{label}",
        "type": message_type,
        "field": field,
    } | more


def diagnostics(level: bytes) -> DiagnosticArray:
    status = DiagnosticStatus(level=level, values=[KeyValue(key="a", value="b")])
    return DiagnosticArray(status=[DiagnosticStatus(), status, *[DiagnosticStatus()] * 500])


def odometry() -> Odometry:
    message = Odometry()
    message.pose.covariance[35] = 0.25
    return message


CASES: list[tuple[str, str, Any, float | None]] = [
    ("sensor_msgs/msg/Temperature", "temperature", Temperature(temperature=61.5), 61.5),
    ("sensor_msgs/msg/Temperature", "temperature", Temperature(temperature=math.nan), None),
    ("sensor_msgs/msg/Temperature", "temperature", Temperature(temperature=-math.inf), None),
    ("sensor_msgs/msg/BatteryState", "cell_voltage[2]", BatteryState(cell_voltage=[3.0, 3.25, 3.5]), 3.5),
    ("sensor_msgs/msg/BatteryState", "cell_voltage[3]", BatteryState(cell_voltage=[3.0, 3.25, 3.5]), None),
    ("sensor_msgs/msg/BatteryState", "power_supply_health", BatteryState(power_supply_health=3), 3.0),
    ("sensor_msgs/msg/JointState", "effort[1]", JointState(effort=[0.5, -0.75]), -0.75),
    ("nav_msgs/msg/Odometry", "pose.covariance[35]", odometry(), 0.25),
    ("std_msgs/msg/Bool", "data", Bool(data=True), 1.0),
    ("std_msgs/msg/Byte", "data", Byte(data=b"\xfe"), 254.0),
    ("std_msgs/msg/UInt64", "data", UInt64(data=2**53), float(2**53)),
    ("std_msgs/msg/Float64MultiArray", "data[0]", Float64MultiArray(data=[1e-9]), 1e-9),
    # A header and a list: it is truncated behind the item before it is decoded.
    ("diagnostic_msgs/msg/DiagnosticArray", "status[1].level", diagnostics(DiagnosticStatus.ERROR), 2.0),
    ("diagnostic_msgs/msg/DiagnosticArray", "header.stamp.sec", diagnostics(DiagnosticStatus.OK), 0.0),
]


@pytest.mark.parametrize(("type_name", "field", "message", "expected"), CASES)
def test_a_field_of_any_type(
    talker: Talker, type_name: str, field: str, message: Any, expected: float | None
) -> None:
    source, board = SourceSettings(**number("x", type_name, field)), Board()
    with intake((source,), board) as running:
        talker.say(running, source.topic, message)
        wait_until(lambda: board[source.spec] is not None, "the value")
    received = board[source.spec]
    assert received
    assert received.value.value == expected
    assert not board.undecodable


TEXTS: list[tuple[str, str, Any, dict[str, Any], str | None]] = [
    ("std_msgs/msg/String", "data", String(data="two\n\x1b[31mlines"), {}, "two \ufffd[31mlines"),
    ("std_msgs/msg/String", "data", String(data="x" * 500_000), {"max_length": 4}, "xxx\u2026"),
    ("sensor_msgs/msg/JointState", "name[1]", JointState(name=["a", "b"]), {}, "b"),
    ("sensor_msgs/msg/JointState", "name[2]", JointState(name=["a", "b"]), {}, None),
    ("diagnostic_msgs/msg/DiagnosticArray", "status[1].values[0].value", diagnostics(b"\0"), {}, "b"),
    (
        "sensor_msgs/msg/BatteryState",
        "power_supply_health",
        BatteryState(power_supply_health=3),
        {"names": {3: "dead"}},
        "dead",
    ),
    ("std_msgs/msg/Bool", "data", Bool(data=True), {"names": {0: "off", 1: "on"}}, "on"),
]


@pytest.mark.parametrize("case", TEXTS, ids=lambda case: f"{case[0]}-{case[1]}")
def test_a_text_of_any_type(talker: Talker, case: tuple[str, str, Any, dict[str, Any], str | None]) -> None:
    type_name, field, message, more, expected = case
    source = SourceSettings(**number("x", type_name, field, **more) | {"kind": "text"})
    board = Board()
    with intake((source,), board) as running:
        talker.say(running, source.topic, message)
        wait_until(lambda: board[source.spec] is not None, "the text")
    received = board[source.spec]
    assert received
    assert received.value.text == expected


@pytest.mark.parametrize(
    ("field", "more", "words"),
    [
        ("voltage", {}, "is of type float, which is no text (an integer is one with 'names')"),
        ("voltage", {"names": {0: "a"}}, "is of type float, which is no integer, which 'names' is for"),
        ("location", {"names": {0: "a"}}, "is of type string, which is no integer"),
        ("header", {}, "is of type std_msgs/msg/Header, which is no text"),
    ],
)
def test_a_field_that_is_no_text(field: str, more: dict[str, Any], words: str) -> None:
    source = SourceSettings(**number("x", "sensor_msgs/msg/BatteryState", field, **more) | {"kind": "text"})
    with pytest.raises(FieldMissingError, match=re.escape(words)):
        check_field(BatteryState, source)


MISSING = [
    ("sensor_msgs/msg/Temperature", "temp", "has no field 'temp'; it has header, temperature, variance"),
    ("sensor_msgs/msg/Temperature", "header.frame_id", "is of type string, which is no number"),
    ("sensor_msgs/msg/Temperature", "header", "is of type std_msgs/msg/Header, which is no number"),
    ("sensor_msgs/msg/Temperature", "temperature.x", "is of type double, which has no fields"),
    ("sensor_msgs/msg/Temperature", "temperature[0]", "is of type double, which has no items"),
    ("sensor_msgs/msg/BatteryState", "cell_voltage", "choose an item, cell_voltage[0] for example"),
    ("nav_msgs/msg/Odometry", "pose.covariance[36]", "has at most 36 items, of which the last is [35]"),
]


@pytest.mark.parametrize(("type_name", "field", "words"), MISSING)
@pytest.mark.usefixtures("ros_domain")
def test_a_field_that_is_not_there_leaves_the_other_sources_alone(
    type_name: str, field: str, words: str
) -> None:
    source = SourceSettings(**number("x", type_name, field))
    other = SourceSettings(**number("y", "std_msgs/msg/Bool", "data"))
    board = Board()
    with intake((source, other), board) as running:
        assert list(running.sources) == ["number.y"]
    unusable = board.unusable[source.spec]
    assert words in unusable.reason
    assert not unusable.lacks_type
    finding = next(each for each in ros_findings((source,)) if each.check == "type.number.x")
    assert finding.verdict is Verdict.WRONG
    assert words in finding.what
    assert f"ros2 interface show {type_name}" in finding.remedy


SOURCES = [
    number(
        "left_motor",
        "sensor_msgs/msg/Temperature",
        "temperature",
        title="Left motor",
        unit="°C",
        decimals=1,
        stale_after_ms=60_000,
        warning_above={"raise_at": 80, "clear_at": 75},
        error_above={"raise_at": 95, "clear_at": 90},
        remedy="Let it cool down",
        tile=True,
    ),
    {
        "kind": "text",
        "label": "gripper",
        "topic": "/gripper",
        "type": "std_msgs/msg/String",
        "field": "data",
        "levels": {"jammed": "error"},
    },
    number("broken", "sensor_msgs/msg/Temperature", "temp"),
]


def shown(gateway: GatewayProgram) -> Any:
    return gateway.status().numbers[0]


def test_from_the_configuration_to_the_operator(talker: Talker, tmp_path: Path) -> None:
    """No code but the configuration: status, table, faults, events, metrics."""
    metrics = free_tcp_port()
    with gateway_program(
        tmp_path, sources=SOURCES, metrics={"port": metrics}, faults={"clear_after_ms": 100}
    ) as gateway:
        publisher = talker.publisher("/left_motor", Temperature)

        def until(temperature: float, holds: Callable[[Any], bool]) -> Any:
            """Publishes until the status has what it should."""

            def there() -> bool:
                publisher.publish(Temperature(temperature=temperature))
                return holds(shown(gateway))

            wait_until(there, f"{temperature} to be shown")
            return shown(gateway)

        good = until(60.04, lambda seen: seen.HasField("value"))
        assert (good.title, good.value, good.unit, good.decimals) == ("Left motor", 60.0, "°C", 1)
        assert (good.level, good.warning_above, good.error_above) == (value_pb2.NUMBER_LEVEL_GOOD, 80, 95)
        assert not good.HasField("error_below")
        hot = until(96.0, lambda seen: seen.level == value_pb2.NUMBER_LEVEL_ERROR_HIGH)
        assert hot.value == 96.0

        target = ("--target", f"127.0.0.1:{gateway.port}")
        wait_until(
            lambda: "number.left_motor.high" in {each.id for each in gateway.status().faults}, "the fault"
        )
        table = robotctl(*target, "status", COLUMNS="200").stdout
        (row,) = [line for line in table.splitlines() if line.lstrip().startswith("Left motor")]
        assert "TOO HIGH" in row
        assert "96.0 °C" in row
        assert "Let it cool down" in table
        document = json.loads(robotctl_process(*target, "status", "--json").stdout)
        assert document["numbers"][0]["level"] == "error_high"
        assert [each["tile"] for each in (*document["numbers"], *document["texts"])] == [True, False, False]

        page = urllib.request.urlopen(f"http://127.0.0.1:{metrics}/metrics", timeout=5).read().decode()
        assert 'robot_gateway_number{source="number.left_motor",unit="°C"} 96.0' in page

        until(math.nan, lambda seen: not seen.HasField("value"))
        assert shown(gateway).level == value_pb2.NUMBER_LEVEL_ERROR_HIGH, "not known to be better"
        until(60.0, lambda seen: seen.level == value_pb2.NUMBER_LEVEL_GOOD)
        wait_until(
            lambda: (
                "cleared: Left motor is too high: 95 °C or more"
                in {event.message for event in gateway.overlay().events}
            ),
            "the event of the end",
        )

        said = talker.publisher("/gripper", String)

        def jammed() -> bool:
            said.publish(String(data="jammed"))
            return bool(gateway.status().texts[0].level == value_pb2.TEXT_LEVEL_ERROR)

        wait_until(jammed, "the text")
        assert gateway.status().texts[0].text == "jammed"
        wait_until(
            lambda: "error: gripper: jammed" in {event.message for event in gateway.overlay().events},
            "the event of the text",
        )
        table = robotctl(*target, "status", COLUMNS="200").stdout
        assert any("gripper" in line and "ERROR" in line and "jammed" in line for line in table.splitlines())

        broken = gateway.source("number.broken")
        assert broken.state == source_pb2.SOURCE_STATE_FIELD_MISSING
        assert "number.broken.field_missing" in {each.id for each in gateway.status().faults}
        assert "has no field 'temp'" in (tmp_path / "gateway.log").read_text(encoding="utf-8")


PAGE = Path(__file__).parents[4] / "docs/configuration.md"


def examples() -> list[str]:
    """The examples of sources on the page, as files."""
    blocks = re.findall(
        r"^```yaml\n(sources:\n.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    assert len(blocks) >= 3
    return blocks


def check(config: Path, *options: str) -> "subprocess.CompletedProcess[str]":
    program = Path(sys.executable).parent / "robot-gateway"
    command = [str(program), "check", "--config", str(config), *options]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("example", examples())
def test_the_examples_of_the_page_are_accepted_and_printed_as_they_are(example: str, tmp_path: Path) -> None:
    config, printed = tmp_path / "gateway.yaml", tmp_path / "printed.yaml"
    config.write_text(example, encoding="utf-8")
    checked = check(config)
    assert (checked.returncode, checked.stderr) == (0, "")
    printed.write_text(check(config, "--print").stdout, encoding="utf-8")
    assert check(printed, "--print").stdout == printed.read_text(encoding="utf-8")


def test_check_refuses_a_field_that_the_type_lacks_and_names_what_it_can_not_know(tmp_path: Path) -> None:
    config = tmp_path / "gateway.yaml"
    absent = number("absent", "no_such_msgs/msg/Thing", "field")
    config.write_text(json.dumps({"sources": [absent]}), encoding="utf-8")
    unknown = check(config)
    assert unknown.returncode == 0
    assert (
        "not checked: field field of 'number.absent': message type no_such_msgs/msg/Thing" in unknown.stderr
    )
    config.write_text(json.dumps({"sources": [absent, SOURCES[-1]]}), encoding="utf-8")
    refused = check(config)
    assert refused.returncode == 2
    assert "has no field 'temp'; it has header, temperature, variance" in refused.stderr
    assert "ros2 interface show sensor_msgs/msg/Temperature" in refused.stderr
