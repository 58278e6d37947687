"""robotctl info, for people and for scripts."""

import io
import json

from rich.console import Console

from console.cli.info import info_json, info_view
from console.client.mapping.methods import GET_GATEWAY_INFO
from omniseer.gateway.v1.robot_gateway_pb2 import GetGatewayInfoResponse


def answer() -> GetGatewayInfoResponse:
    message = GetGatewayInfoResponse(gateway_name="lab-1", gateway_version="1.2.3")
    message.wall_clock_unix_ms = 1_700_000_000_000
    message.gateway.revision, message.gateway.uptime_ms = "ab" * 20, 65_000
    message.methods.add(method="GetSystemStatus", served=12, refused=3, failed=1)
    message.configuration_json = '{\n  "name": "lab-1"\n}'
    return message


def test_people_see_the_build_the_calls_and_the_configuration() -> None:
    console = Console(file=io.StringIO(), width=120, highlight=False, markup=False)
    decoded = GET_GATEWAY_INFO.decode(answer().SerializeToString())
    console.print(info_view(decoded, "robot:50051", full=True))
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    for part in ("lab-1", "robot:50051", "1.2.3", "ab" * 20, "1 min 05 s", "2023-11-14T22:13:20"):
        assert part in text
    assert ["GetSystemStatus", "12", "3", "1"] in [line.split() for line in text.splitlines()]
    assert '  "name": "lab-1"' in text


def test_the_configuration_is_left_out_unless_it_is_requested() -> None:
    console = Console(file=io.StringIO(), width=120, highlight=False, markup=False)
    console.print(info_view(GET_GATEWAY_INFO.decode(answer().SerializeToString()), "robot:50051"))
    assert isinstance(console.file, io.StringIO)
    assert '"name"' not in console.file.getvalue()
    assert "robotctl info --full" in console.file.getvalue()


def test_scripts_get_the_configuration_as_an_object() -> None:
    document = info_json(GET_GATEWAY_INFO.decode(answer().SerializeToString()))
    assert json.loads(json.dumps(document)) == document
    assert document["configuration"] == {"name": "lab-1"}
    assert document["gateway"]["uptime_ms"] == 65_000
    assert document["gateway"]["boot_id"] is None


def test_a_gateway_that_reports_no_configuration_is_no_error() -> None:
    assert info_json(GET_GATEWAY_INFO.decode(b""))["configuration"] is None
