"""robotctl fleet against a real NATS server, with the real messages of robots."""

import asyncio
import json
import re
import select
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from nacl.signing import SigningKey

from bridge.config import BridgeSettings
from console.fleet.hub import EventQuery, read_events, read_recordings
from console.fleet.values import FleetItem, RobotEvent
from console.fleet.values import StoredRecording as Stored
from fleet.connection import Hub
from fleet.receipts import PURPOSE, key_id
from omniseer.fleet.v1.command_pb2 import (
    COMMAND_OUTCOME_DONE,
    COMMAND_OUTCOME_REFUSED,
    Command,
    CommandResult,
)
from omniseer.fleet.v1.event_pb2 import DROP_REASON_OUTBOX_FULL, DroppedEvents
from omniseer.fleet.v1.state_pb2 import RobotState
from omniseer.fleet.v1.upload_pb2 import Receipt, SignedReceipt, StoredRecording
from omniseer.gateway.v1.fault_pb2 import FAULT_SEVERITY_ERROR, FAULT_SEVERITY_WARNING
from omniseer.gateway.v1.recording_pb2 import Recording
from omniseer.gateway.v1.value_pb2 import NUMBER_LEVEL_ERROR_HIGH, TEXT_LEVEL_GOOD
from tests.support.control_characters import CONTROL_CHARACTERS, change_texts
from tests.support.filled import fill
from tests.support.fleet_hub import FleetHub, fleet_hub
from tests.support.fleet_values import batch, event, healthy_state, wrong_bytes
from tests.support.free import free_tcp_port
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.nats_servers import nats_servers
from tests.support.robotctl import ENDS_WITHIN_S, ROBOTCTL, environment, only_line, robotctl, robotctl_process
from tests.support.silent_server import silent_server, tried_in_order
from tests.support.terminal import terminal_with

NEVER = set(CONTROL_CHARACTERS) - {"\n"}


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[FleetHub]:
    with fleet_hub(tmp_path) as made:
        yield made


def answer(hub: FleetHub, *words: str) -> Any:
    done = robotctl("fleet", *words, "--hub", hub.urls, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(done.stdout)


def shown(hub: FleetHub, *words: str) -> list[str]:
    done = robotctl("fleet", *words, "--hub", hub.urls)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.splitlines()


def test_the_whole_fleet_at_a_glance(hub: FleetHub) -> None:
    hub.enroll("lab1", "lab2", "lab3")
    hub.enroll("old", revoked=True)
    hub.put_state(healthy_state("lab1"))
    ill = healthy_state("lab2")
    ill.faults.add(severity=FAULT_SEVERITY_ERROR, message="lidar silent")
    ill.fault_count, ill.battery_percent = 2, 5
    hub.put_state(ill)
    lines = shown(hub, "list")
    assert lines[0].split() == [
        "robot", "since", "health", "battery", "disk", "mode", "uploads", "outbox", "seen"
    ]  # fmt: skip
    assert [line.split()[:2] for line in lines[1:5]] == [
        ["lab1", "UP"],
        ["lab2", "UP"],
        ["lab3", "NEVER"],
        ["old", "REVOKED"],
    ]
    assert "error: lidar silent (+1)" in lines[2]
    assert "5 %, LOW" in lines[2]
    assert lines[-1] == "2 of 3 robots up, 1 with errors"
    document = answer(hub, "list")
    assert [row["standing"] for row in document["robots"]] == ["up", "up", "never seen", "revoked"]
    # By the hub's clock, a moment ago.
    assert 0 <= document["robots"][0]["last_seen_ms"] < 10_000
    assert document["summary"]["with_errors"] == 1


def test_the_values_of_a_robots_configuration(hub: FleetHub) -> None:
    hub.enroll("lab1", "lab2")
    state = healthy_state("lab1")
    state.numbers.add(
        label="motor", title="Motor", available=True, value=91.5, unit="°C", level=NUMBER_LEVEL_ERROR_HIGH
    )
    state.texts.add(label="arm", title="Arm", available=True, text="open", level=TEXT_LEVEL_GOOD)
    state.position.available = True
    state.position.latitude_deg, state.position.longitude_deg = 47.5, 8.25
    hub.put_state(state)
    lines = shown(hub, "show", "lab1")
    assert lines[0].startswith("lab1  seen ")
    assert ["Motor", "TOO", "HIGH", "91.5", "°C"] in [line.split()[:5] for line in lines]
    assert ["Arm", "fresh", "open"] in [line.split()[:3] for line in lines]
    assert any("47.500000°, 8.250000°" in line for line in lines)
    document = answer(hub, "show", "lab1")
    assert document["standing"] == "up"
    (number,) = document["state"]["numbers"]
    assert (number["label"], number["value"], number["level"]) == ("motor", 91.5, "error_high")
    assert document == answer(hub, "list")["robots"][0] | {
        key: document[key] for key in ("last_seen_ms", "since_ms")
    }
    (first,) = (line for line in shown(hub, "watch", "--count", "1") if "lab1" in line)
    assert "Motor 91.5 °C TOO HIGH, Arm open" in first
    assert shown(hub, "show", "lab2")[-1].split()[:3] == ["standing", "NEVER", "SEEN"]
    unknown = robotctl("fleet", "show", "lab3", "--hub", hub.urls)
    assert unknown.returncode == 2
    assert "no robot of the fleet is called 'lab3'" in unknown.stderr


def test_a_fleet_without_robots(hub: FleetHub) -> None:
    assert shown(hub, "list") == ["No robot is enrolled yet."]
    assert shown(hub, "recordings") == ["No recording was uploaded yet."]
    assert shown(hub, "events") == []


def test_events_and_gaps_of_all_robots_or_one(hub: FleetHub) -> None:
    gap = DroppedEvents(
        reason=DROP_REASON_OUTBOX_FULL,
        first_sequence=2,
        last_sequence=8,
        worst_severity=FAULT_SEVERITY_WARNING,
        earlier_run_incomplete=True,
    )
    hub.put_events(
        batch("lab1", event(1), gap, event(9)), batch("lab2", event(1, severity=FAULT_SEVERITY_ERROR))
    )
    lines = shown(hub, "events")
    assert [line[26:] for line in (lines[0], lines[2], lines[3])] == [
        "lab1          info     lidar       event 1",
        "lab1          info     lidar       event 9",
        "lab2          error    lidar       event 1",
    ]
    assert lines[1] == (
        "--- lab1: 7 events missing, the worst of severity warning: the robot's outbox was full; "
        "of an earlier run, too, an unknown number"
    )
    assert len(shown(hub, "events", "lab2")) == 1
    assert [line.split()[3] for line in shown(hub, "events", "--severity", "error")] == ["lab2"]
    # A gap that may hide a warning stays.
    assert len(shown(hub, "events", "--severity", "warning")) == 2
    assert shown(hub, "events", "--since", "2100-01-01") == []
    assert shown(hub, "events", "nothere") == []


def test_events_are_followed_until_ctrl_c(hub: FleetHub) -> None:
    hub.put_events(batch("lab1", event(1)))
    with subprocess.Popen(
        [ROBOTCTL, "fleet", "events", "--follow", "--json", "--hub", hub.urls],
        stdout=subprocess.PIPE,
        text=True,
        env=environment(),
    ) as process:
        try:
            assert process.stdout
            first = json.loads(process.stdout.readline())
            hub.put_events(batch("lab1", event(2)))
            second = json.loads(process.stdout.readline())
            process.terminate()
            assert process.wait(ENDS_WITHIN_S) == 0
        finally:
            process.kill()
    assert [each["event"]["event"]["position"]["sequence"] for each in (first, second)] == [1, 2]


def test_only_new_events_are_followed_each_once_and_in_order(hub: FleetHub) -> None:
    hub.put_events(batch("lab1", event(1)), batch("lab2", event(1)))
    words = ["fleet", "events", "--follow", "--since", "new", "--json", "--hub", hub.urls]
    with subprocess.Popen(
        [ROBOTCTL, *words], stdout=subprocess.PIPE, text=True, env=environment()
    ) as process:
        try:
            assert process.stdout
            # When it begins to listen only its first line shows.
            last = 1
            while last < 1000 and not select.select([process.stdout], [], [], 0.1)[0]:
                last += 1
                hub.put_events(batch("lab1", event(last)))
            hub.put_events(batch("lab1", event(last + 1)))
            seen: list[int] = []
            while not seen or seen[-1] <= last:
                item = json.loads(process.stdout.readline())["event"]
                assert item["robot"] == "lab1"
                seen.append(item["event"]["position"]["sequence"])
            process.terminate()
            assert process.wait(ENDS_WITHIN_S) == 0
        finally:
            process.kill()
    assert seen[0] > 1
    assert seen == list(range(seen[0], last + 2))


def test_new_events_of_a_robot_without_any(hub: FleetHub, monkeypatch: pytest.MonkeyPatch) -> None:
    hub.put_events(batch("lab1", event(1)))

    async def first(connection: Hub) -> FleetItem:
        asked, last = asyncio.Event(), connection.last

        async def noted(stream: str, subjects: str) -> Any:
            found = await last(stream, subjects)
            asked.set()
            return found

        monkeypatch.setattr(connection, "last", noted)
        items = read_events(connection, EventQuery("lab2", None, follow=True))
        coming = asyncio.ensure_future(anext(items))
        # What counts as new is what the hub takes after this answer, whenever it is read.
        await asked.wait()
        await asyncio.to_thread(hub.put_events, batch("lab1", event(2)), batch("lab2", event(1)))
        return await asyncio.wait_for(coming, ENDS_WITHIN_S)

    found = hub.run(first)
    assert isinstance(found, RobotEvent)
    assert found.robot == "lab2"


def test_new_alone_is_a_mistake() -> None:
    done = robotctl("fleet", "events", "--since", "new", "--hub", "nats://127.0.0.1:1")
    assert done.returncode == 2
    assert "fleet events --follow --since new" in done.stderr


def stored(robot: str, recording_id: str, key: SigningKey, **wrong: Any) -> StoredRecording:
    made = StoredRecording(recording=Recording(id=recording_id, label="crash", size=5000, sha256=b"s" * 32))
    said: dict[str, Any] = {"robot": robot, "recording_id": recording_id, "size": 5000, "sha256": b"s" * 32}
    receipt = Receipt(fleet="lab", **(said | wrong), location=f"s3://fleet/{robot}").SerializeToString()
    made.receipt.CopyFrom(
        SignedReceipt(
            receipt=receipt,
            signature=key.sign(PURPOSE + receipt).signature,
            key_id=key_id(bytes(key.verify_key)),
        )
    )
    return made


def test_recordings_with_their_receipts_checked(hub: FleetHub) -> None:
    receiver, other = (SigningKey.generate() for _ in range(2))
    hub.put_recording("lab1", stored("lab1", "good", receiver))
    hub.put_recording("lab1", stored("lab1", "other", receiver, sha256=b"t" * 32))
    hub.put_recording("lab2", stored("lab1", "stolen", receiver))
    hub.put_recording("lab2", stored("lab2", "forged", other))
    bent = stored("lab2", "bent", receiver)
    bent.receipt.signature = b"\0" * 64
    hub.put_recording("lab2", bent)
    hub.put_recording("lab3", StoredRecording(recording=Recording(id="none")))
    hub.put_recording("lab3", b"\xff\xff", "junk")
    items = hub.run(lambda connection: read_recordings(connection, "lab", (bytes(receiver.verify_key),)))
    assert {each.recording.id: each.receipt.value for each in items if isinstance(each, Stored)} == {
        "good": "verified",
        "other": "invalid",
        "stolen": "invalid",
        "forged": "unknown key",
        "bent": "invalid",
        "none": "no receipt",
    }
    (line,) = (line for line in shown(hub, "recordings", "lab3") if "unreadable" in line)
    assert "the bytes are no message" in line
    # Without a login no key is known.
    assert {each["receipt"] for each in answer(hub, "recordings", "lab1")["recordings"]} == {"unknown key"}


def test_a_command_and_its_answer(hub: FleetHub) -> None:
    hub.enroll("lab1")
    hub.put_state(healthy_state("lab1"))

    def carry_out(command: Command) -> CommandResult:
        assert command.WhichOneof("action") == "snapshot"
        return CommandResult(
            command_id=command.command_id,
            robot="lab1",
            outcome=COMMAND_OUTCOME_DONE,
            message="kept",
            recording_id="r-1",
        )

    with robot_that_answers(hub, carry_out) as commands:
        done = robotctl(
            "fleet", "command", "lab1", "snapshot", "--before", "5", "--label", "x", "--hub", hub.urls
        )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "DONE  lab1: kept (r-1)\n"
    (command,) = commands
    assert (command.snapshot.pre_s, command.snapshot.HasField("post_s"), command.snapshot.label) == (
        5,
        False,
        "x",
    )
    assert command.expires_after_s == 60
    assert command.issued_by


def test_a_refusal_ends_1_and_says_why(hub: FleetHub) -> None:
    hub.enroll("lab1")
    hub.put_state(healthy_state("lab1"))

    def refuse(command: Command) -> CommandResult:
        return CommandResult(
            command_id=command.command_id,
            robot="lab1",
            outcome=COMMAND_OUTCOME_REFUSED,
            message="this robot does not allow uploads\x1b[2J",
        )

    with robot_that_answers(hub, refuse) as commands:
        done = robotctl("fleet", "command", "lab1", "upload", "r-1", "--hub", hub.urls)
    assert done.returncode == 1
    assert done.stdout == "REFUSED  lab1: this robot does not allow uploads [2J\n"
    assert commands[0].upload.recording_id == "r-1"


@contextmanager
def robot_that_answers(hub: FleetHub, answer: Callable[[Command], CommandResult]) -> Iterator[list[Command]]:
    """A robot that answers one command, in a thread; the list has that command at the end."""
    commands: list[Command] = []
    listens = threading.Event()

    def listen() -> None:
        commands.append(asyncio.run(hub.answer_command("lab1", answer, listens.set)))

    robot = threading.Thread(target=listen)
    robot.start()
    try:
        assert listens.wait(ENDS_WITHIN_S)
        yield commands
    finally:
        robot.join(ENDS_WITHIN_S)


def test_a_command_that_no_robot_takes_expires(hub: FleetHub) -> None:
    hub.enroll("lab1")
    with mock.patch("console.cli.fleet.ANSWER_AFTER_EXPIRY_S", 0.1):
        done = robotctl("fleet", "command", "lab1", "snapshot", "--expires", "1", "--hub", hub.urls)
    assert done.returncode == 3
    waits, error = done.stderr.splitlines()
    assert waits == "lab1 is never seen; the command waits for it for 1 s"
    assert "has not answered the command before it expired" in error


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("command", "lab1", "upload"), 2, "upload needs the ID"),
        (("command", "lab1", "snapshot", "r-1"), 2, "snapshot takes no ID"),
        (("command", "lab1", "delete", "r-1"), 2, "not one of snapshot, upload"),
        (("command", "lab", "snapshot"), 2, "Did you mean 'lab1'?"),
        (("command", "old", "snapshot"), 1, "is revoked"),
        (("monitor", "lab1"), 1, "does not report where its gateway is"),
        (("monitor", "nothere"), 2, "no robot of the fleet"),
        (("events", "--since", "yesterday"), 2, "is no time"),
    ],
)
def test_what_can_not_be_done_says_what_to_do(
    shared_hub: FleetHub, words: tuple[str, ...], code: int, said: str
) -> None:
    done = robotctl("fleet", *words, "--hub", shared_hub.urls)
    assert done.returncode == code
    assert said in only_line(done.stderr)


def test_the_setting_that_gives_a_robot_an_address_is_one_of_the_bridge(shared_hub: FleetHub) -> None:
    """The defect: the bridge has no setting of the name that was given, and does not start with one."""
    done = robotctl("fleet", "monitor", "lab1", "--hub", shared_hub.urls)
    named = re.search(r"Set '(\w+)' in the robot's bridge\.yaml", only_line(done.stderr))
    assert named
    settings = BridgeSettings.model_validate({named[1]: "10.0.0.7:50051"})
    assert settings.advertised_target == "10.0.0.7:50051"


@pytest.fixture(scope="module")
def shared_hub(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FleetHub]:
    with fleet_hub(tmp_path_factory.mktemp("hub")) as made:
        made.enroll("lab1")
        made.enroll("old", revoked=True)
        made.put_state(healthy_state("lab1"))
        yield made


def test_a_monitor_of_a_robot_that_can_not_be_reached_from_here(shared_hub: FleetHub) -> None:
    state = healthy_state("far")
    state.gateway_target = f"127.0.0.1:{free_tcp_port()}"
    shared_hub.put_state(state)
    done = robotctl("fleet", "monitor", "far", "--hub", shared_hub.urls)
    assert done.returncode == 3
    assert f"the gateway of far can't be reached from here at {state.gateway_target}" in only_line(
        done.stderr
    )
    state.gateway_target = "\x1b]0;x\x07 --nonsense"
    shared_hub.put_state(state)
    done = robotctl("fleet", "monitor", "far", "--hub", shared_hub.urls)
    assert done.returncode == 1
    assert "far reports no address of a gateway" in only_line(done.stderr)


def test_the_monitor_is_opened_where_the_robot_says_that_it_is(shared_hub: FleetHub) -> None:
    with serving(GatewayDouble()) as port:
        state = healthy_state("near")
        state.gateway_target = f"127.0.0.1:{port}"
        shared_hub.put_state(state)
        with mock.patch("console.cli.windows.open_monitor") as opened:
            done = robotctl("fleet", "monitor", "near", "--hub", shared_hub.urls)
    assert (done.returncode, done.stderr) == (0, "")
    ((session_of_robot,), _) = opened.call_args
    assert session_of_robot().target == state.gateway_target


def test_without_a_hub_it_ends_3_with_one_line() -> None:
    servers = f"nats://127.0.0.1:{free_tcp_port()}"
    for words in (
        ("list",),
        ("watch", "--count", "1"),
        ("events",),
        ("recordings",),
        ("command", "a", "snapshot"),
    ):
        done = robotctl("fleet", *words, "--hub", servers)
        assert done.returncode == 3, words
        assert done.stdout == ""
        assert "can't be reached" in only_line(done.stderr)
    error = json.loads(only_line(robotctl("fleet", "list", "--hub", servers, "--json").stderr))["error"]
    assert (error["kind"], error["exit_code"]) == ("unreachable", 3)


def test_a_silent_server_is_passed_over(shared_hub: FleetHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: where it was tried first, the hub was said not to answer."""
    tried_in_order(monkeypatch)
    monkeypatch.setattr("console.cli.fleet_session.ANSWERS_WITHIN_S", 30.0)
    with silent_server() as silent:
        done = robotctl("fleet", "list", "--hub", f"{silent},{shared_hub.urls}", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert "lab1" in [row["robot"] for row in json.loads(done.stdout)["robots"]]


def test_where_every_server_is_silent_it_says_for_how_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: "within 0 s"."""
    tried_in_order(monkeypatch)
    monkeypatch.setattr("console.cli.fleet_session.ANSWERS_WITHIN_S", 0.5)
    with silent_server() as silent:
        done = robotctl("fleet", "list", "--hub", silent)
    assert done.returncode == 3
    assert "the hub does not answer within 0.5 s" in only_line(done.stderr)


def test_a_hub_that_is_not_set_up(tmp_path: Path) -> None:
    with nats_servers(tmp_path) as servers:
        done = robotctl("fleet", "list", "--hub", servers.urls[0])
    assert done.returncode == 1
    assert only_line(done.stderr).endswith("robot-bridge hub apply")


def test_the_installed_program_without_a_login() -> None:
    done = robotctl_process("fleet", "list")
    assert done.returncode == 2
    assert "there is no login for a fleet" in only_line(done.stderr)


def hostile_states() -> Iterator[RobotState]:
    for robot, text in (("control", f"{CONTROL_CHARACTERS}\x1b]52;c;cm0gLXJm\x07"), ("giant", "x" * 12_000)):
        state = RobotState()
        fill(state)
        change_texts(state, lambda _, text=text: text)  # type: ignore[misc]
        state.robot = robot
        yield state


@pytest.fixture(scope="module")
def hostile_hub(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FleetHub]:
    """A hub in which every robot has put something else that none may."""
    with fleet_hub(tmp_path_factory.mktemp("hostile")) as made:
        for state in hostile_states():
            made.put_state(state)
        made.put_state(healthy_state("lab1").SerializeToString(), robot="another")
        for number, payload in enumerate(wrong_bytes()):
            made.put_state(payload, robot=f"bytes{number}")
            made.put_bytes(f"fleet.bytes{number}.ev.g1.{number}", payload)
            made.put_recording("lab1", payload, f"r{number}")
        loud = event(1, message=CONTROL_CHARACTERS)
        loud.component = loud.fault_raised.fault.message = f"{CONTROL_CHARACTERS}\x1b[2J"
        made.put_events(batch("control", loud), batch("giant", event(1, message="y" * 200_000)))
        recording = stored("control", "r1", SigningKey.generate())
        change_texts(recording.recording, lambda _: CONTROL_CHARACTERS)
        recording.recording.id = "r1"
        made.put_recording("control", recording)
        yield made


@pytest.mark.parametrize("form", [(), ("--json",)], ids=["table", "json"])
@pytest.mark.parametrize(
    "words",
    [("list",), ("watch", "--count", "1"), ("show", "control"), ("events",), ("recordings",)],
    ids=" ".join,
)
def test_nothing_reaches_the_terminal_but_text(
    hostile_hub: FleetHub, words: tuple[str, ...], form: tuple[str, ...]
) -> None:
    done = robotctl("fleet", *words, "--hub", hostile_hub.urls, *form)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout
    assert not NEVER & set(done.stdout)
    if not form:
        assert max(map(len, done.stdout.splitlines())) < 700


def test_a_hostile_robot_does_not_move_the_columns_of_the_others(hostile_hub: FleetHub) -> None:
    hostile_hub.put_state(healthy_state("tidy"))
    lines = shown(hostile_hub, "list")
    place = lines[0].index("battery") + len("battery") - len("78 %")
    tidy = next(line for line in lines if line.startswith("tidy"))
    assert tidy[place : place + 4] == "78 %"
    assert all(len(line) <= 160 for line in lines)


def test_the_table_is_redrawn_in_place(hub: FleetHub) -> None:
    hub.enroll("lab1", "lab2")
    hub.put_state(healthy_state("lab1"))
    command = [str(ROBOTCTL), "fleet", "watch", "--interval", "0.25", "--hub", hub.urls]
    with terminal_with(command, columns=120) as screen:
        screen.wait_to_see("1 of 2 robots up")
        hub.put_state(healthy_state("lab2"))
        screen.wait_to_see("2 of 2 robots up")
        hub.servers.kill(0)
        screen.wait_to_see("THE HUB DOES NOT ANSWER")
        hub.servers.start_all()
        ill = healthy_state("lab2")
        ill.faults.add(severity=FAULT_SEVERITY_ERROR, message="lidar silent")
        hub.put_state(ill)
        screen.wait_to_see("error: lidar silent")
        screen.press("\x03")
        assert screen.process.wait(ENDS_WITHIN_S) == 0
        assert "Traceback" not in screen.read()


def test_a_pipe_gets_a_line_for_each_robot_that_has_changed(hub: FleetHub) -> None:
    hub.enroll("lab1", "lab2")
    command = [str(ROBOTCTL), "fleet", "watch", "--interval", "0.25", "--hub", hub.urls]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment()) as process:
        try:
            assert process.stdout
            assert "lab1  NEVER SEEN" in process.stdout.readline()
            assert "lab2  NEVER SEEN" in process.stdout.readline()
            hub.put_state(healthy_state("lab2"))
            assert "lab2  UP  robot healthy" in process.stdout.readline()
            process.terminate()
            assert process.wait(ENDS_WITHIN_S) == 0
            # An age alone is no change.
            assert process.stdout.read() == ""
        finally:
            process.kill()


def test_a_fleet_of_more_robots_than_are_read_at_once(hub: FleetHub) -> None:
    names = [f"r{number}" for number in range(600)]
    hub.enroll(*names)
    hub.put_state(healthy_state("r7"))
    document = answer(hub, "list")
    assert {row["robot"] for row in document["robots"]} == set(names)
    assert document["summary"]["up"] == 1
