"""What robotctl says to a newcomer: suggestions, commands that can be pasted, names, and no noise."""

import asyncio
import json
from pathlib import Path

import pytest
from demo_program.ground import Ground
from demo_program.show import hints

from gateway.status.event import ClientJoined, ClientLeft, Event
from gateway.status.fault import Severity
from omniseer.gateway.v1 import fault_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.event_server import EventServer
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.robotctl import only_line, robotctl, robotctl_process


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (
            ["--robot", "lab2", "statsu"],
            "error: No such command 'statsu'. Did you mean 'status'? Type: robotctl --robot lab2 --help",
        ),
        (
            ["preview", "on", "--target", "lab:1", "--profle", "balanced"],
            "error: No such option: --profle. Did you mean --profile? "
            "Type: robotctl --target lab:1 preview on --help",
        ),
        (
            ["preview", "on", "--profile", "low"],
            "error: Invalid value for '--profile': 'low' is not one of low-bw, balanced, high-quality. "
            "Did you mean low-bw? Type: robotctl preview on --help",
        ),
    ],
)
def test_a_wrong_command_line_says_what_was_meant_and_repeats_the_robot(words: list[str], line: str) -> None:
    ended = robotctl(*words)
    assert ended.returncode == 2
    assert only_line(ended.stderr) == line


def test_the_remedies_of_errors_and_findings_can_be_pasted(tmp_path: Path) -> None:
    double = GatewayDouble()
    double.status.preview.state = states.PREVIEW_FAULTED
    double.status.faults.add(
        id="preview.faulted",
        active=True,
        severity=fault_pb2.FAULT_SEVERITY_ERROR,
        message="no camera",
        remedy="to retry at once type: robotctl preview on",
    )
    with serving(double) as port:
        robotctl("robots", "add", "lab2", f"127.0.0.1:{port}", XDG_CONFIG_HOME=str(tmp_path))
        found = robotctl("--robot", "lab2", "doctor", "--json", XDG_CONFIG_HOME=str(tmp_path)).stdout
        info = robotctl("--robot", "lab2", "info", XDG_CONFIG_HOME=str(tmp_path)).stdout
    remedies = {each["check"]: each["remedy"] for each in json.loads(found)["findings"]}
    assert remedies["fault.preview.faulted"] == "to retry at once type: robotctl --robot lab2 preview on"
    assert info.splitlines()[-1].strip() == "configuration: robotctl --robot lab2 info --full"


def test_a_login_that_is_stored_already_is_repeated_whole(tmp_path: Path) -> None:
    store = tmp_path / "robotctl/config.toml"
    store.parent.mkdir()
    store.write_text('[robots.lab2]\ntarget = "lab2"\ntoken_file = "token"\n')
    ended = robotctl("login", "lab2", "lab3.local", "a b.login", "--offline", XDG_CONFIG_HOME=str(tmp_path))
    assert ended.returncode == 2
    assert only_line(ended.stderr).endswith(
        "Type: robotctl login lab2 lab3.local 'a b.login' --offline --replace"
    )


def test_doctor_says_nothing_of_encoders_while_the_preview_is_off() -> None:
    double = GatewayDouble()
    double.status.preview.encoder.name = "x264"  # of the last time that it ran
    with serving(double) as port:
        shown = robotctl("--target", f"127.0.0.1:{port}", "doctor", "--json").stdout
    found = json.loads(shown)["findings"]
    assert "tcp" in {each["check"] for each in found}, "it has looked"
    assert [each for each in found if "encode" in json.dumps(each)] == []


async def test_who_joins_is_shown_by_name_and_on_request_only() -> None:
    async with EventServer(kept=10) as server:
        for detail in (ClientJoined("10.0.0.5:4711", "anna"), ClientLeft("10.0.0.6:4712")):
            name = detail.who or detail.address
            server.note(Event(Severity.INFO, "gateway", f"{name} came or went", detail))
        server.happen(1)
        target = f"127.0.0.1:{server.port}"

        def shown(*words: str) -> str:
            return robotctl_process("--target", target, "events", *words).stdout

        quiet, all_of_them, as_json = await asyncio.gather(
            asyncio.to_thread(shown),
            asyncio.to_thread(shown, "--clients"),
            asyncio.to_thread(shown, "--json"),
        )
    assert len(quiet.splitlines()) == 1
    assert "came or went" not in quiet
    assert [name in all_of_them for name in ("anna came", "10.0.0.6:4712 came")] == [True, True]
    events = [json.loads(line)["event"] for line in as_json.splitlines()]
    assert [(each["client_name"], each["client_address"]) for each in events] == [
        ("anna", "10.0.0.5:4711"),
        ("", "10.0.0.6:4712"),
        (None, None),
    ]


def test_the_demo_names_the_windows_first(tmp_path: Path) -> None:
    commands = [line for line in hints(Ground(tmp_path, 50051, 7100, 0)).splitlines() if ".venv/bin" in line]
    assert [line.split()[1] for line in commands[:2]] == ["monitor", "view"]
