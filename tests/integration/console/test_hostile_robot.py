"""robotctl and a robot, or what pretends to be one, that sends what no gateway sends."""

import json
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import grpc
import pytest
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass

from omniseer.gateway.v1 import event_pb2, recording_pb2, states_pb2, teleop_pb2
from omniseer.gateway.v1.robot_gateway_pb2 import SubscribeEventsResponse, WatchSystemStatusResponse
from tests.support.control_characters import CONTROL_CHARACTERS, change_texts
from tests.support.filled import fields_of, fill
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.kitty import robotctl_on_kitty
from tests.support.robotctl import robotctl, robotctl_process

NEVER = set(CONTROL_CHARACTERS) - {"\n"}
LATEST = 2**63 - 1
ARMED_AFTER = 50
"""Commands, of which a driver sends 50 a second."""
HOSTILE = f"{CONTROL_CHARACTERS}\x1b]52;c;cm0gLXJm\x07"
OURS = re.compile(r"\x1b\[(?:2K|\?1004[hl]|\?u|5n|c)|\r\n|\r(?=\x1b\[2K)|\r$")
"""What robotctl itself has a terminal do: draw a line anew, report its focus, and say which keys it reports,
how it is and what it is."""


class HostileRobot(GatewayDouble):
    """Every text is full of control characters, and every clock is far ahead."""

    def __init__(self) -> None:
        super().__init__()
        for message in (self.status, self.overlay, self.info):
            message.Clear()
            hostile(message)
        self.info.configuration_json = json.dumps({"name": CONTROL_CHARACTERS})
        self.info.wall_clock_unix_ms = LATEST
        self.status.preview.state = states_pb2.PREVIEW_RUNNING
        self.status.teleop.state = states_pb2.TELEOP_ENABLED

    def WatchSystemStatus(self, _request: Any, _context: Any) -> Iterator[WatchSystemStatusResponse]:  # noqa: N802
        yield WatchSystemStatusResponse(status=self.status, monotonic_ns=LATEST)

    def SubscribeEvents(self, _request: Any, _context: Any) -> Iterator[SubscribeEventsResponse]:  # noqa: N802
        for number, field in enumerate(event_pb2.Event.DESCRIPTOR.oneofs_by_name["payload"].fields):
            event = event_pb2.Event()
            for each in fields_of(event):
                if each.containing_oneof is None and not each.message_type:
                    setattr(event, each.name, "a" if each.cpp_type == each.CPPTYPE_STRING else 2)
            fill(getattr(event, field.name))
            change_texts(event, lambda _text: HOSTILE)
            event.run_id, event.sequence, event.wall_clock_unix_ms = "a", number + 1, LATEST
            yield SubscribeEventsResponse(event=event)
        yield SubscribeEventsResponse(caught_up=event_pb2.EventPosition(run_id="a", sequence=99))


def hostile(message: Message) -> None:
    """Everything is set, and each text is hostile."""
    fill(message)
    change_texts(message, lambda _text: HOSTILE)


def driven(requests: Iterator[bytes], _context: Any) -> Iterator[bytes]:
    """A drive: the robot is stopped at first, then free; each command is acknowledged by its own number."""
    opened = teleop_pb2.DriveOpened()
    hostile(opened)
    yield teleop_pb2.DriveResponse(opened=opened).SerializeToString()
    for number, request in enumerate(requests, 1):
        state = teleop_pb2.DriveState()
        hostile(state)
        state.phase = teleop_pb2.DRIVE_PHASE_STOPPED
        state.newest_sequence = teleop_pb2.DriveRequest.FromString(request).command.sequence
        if number > ARMED_AFTER:
            state.phase = teleop_pb2.DRIVE_PHASE_ARMED
            for field in ("inhibits", "problems", "stop"):
                state.ClearField(field)
        state.monotonic_ns = time.monotonic_ns()
        yield teleop_pb2.DriveResponse(state=state).SerializeToString()


def answer_with(message: Message) -> bytes:
    """An answer of this type, which robotctl shows."""
    hostile(message)
    if isinstance(message, recording_pb2.GetRecordingResponse):
        # With all of its files: pages without an end are refused, and a list that lacks some.
        message.next_page_token, message.recording.file_count = "", len(message.recording.files)
    return message.SerializeToString()


def handlers() -> Iterator[grpc.GenericRpcHandler]:
    """The services of driving and of recordings: every answer of theirs is hostile."""
    for file in (teleop_pb2, recording_pb2):
        for service in file.DESCRIPTOR.services_by_name.values():
            by_name: dict[str, grpc.RpcMethodHandler[Any, Any]] = {}
            for name, method in service.methods_by_name.items():
                answer = answer_with(GetMessageClass(method.output_type)())
                if method.client_streaming:
                    by_name[name] = grpc.stream_stream_rpc_method_handler(driven)
                elif method.server_streaming:
                    by_name[name] = grpc.unary_stream_rpc_method_handler(lambda *_, each=answer: iter([each]))
                else:
                    by_name[name] = grpc.unary_unary_rpc_method_handler(lambda *_, each=answer: each)
            yield grpc.method_handlers_generic_handler(service.full_name, by_name)


@pytest.fixture
def target() -> Iterator[str]:
    with serving(HostileRobot(), 0, *handlers()) as port:
        yield f"127.0.0.1:{port}"


COMMANDS = [
    ("status",),
    ("watch", "--count", "1"),
    ("overlay",),
    ("info",),
    ("events",),
    ("doctor",),
    ("preview", "on", "--wait", "0"),
    ("stop",),
    ("reset-stop", "1"),
    *(("record", word) for word in ("start", "stop", "snapshot", "list")),
    *(("record", word, "ID") for word in ("show", "pin", "unpin", "delete", "upload", "cancel-upload")),
]


@pytest.mark.parametrize("form", [(), ("--json",)], ids=["table", "json"])
@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_nothing_reaches_the_terminal_but_text(
    target: str, words: tuple[str, ...], form: tuple[str, ...]
) -> None:
    done = robotctl("--target", target, *form, *words)
    assert "Traceback" not in done.stderr
    assert done.returncode in (0, 1)
    assert done.stdout
    assert not NEVER & set(done.stdout + done.stderr)


@pytest.mark.parametrize("form", [(), ("--json",)], ids=["line", "json"])
def test_a_copy_of_a_hostile_recording_is_refused_in_text(
    target: str, form: tuple[str, ...], tmp_path: Path
) -> None:
    done = robotctl("--target", target, *form, "record", "export", "ID", "--to", str(tmp_path))
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert done.stderr
    assert not NEVER & set(done.stdout + done.stderr)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("form", [(), ("--json",)], ids=["line", "json"])
def test_nothing_else_reaches_it_while_driving(target: str, form: tuple[str, ...]) -> None:
    """Who stopped the robot and why is shown, and later how it confirms the driver's own stop."""
    with robotctl_on_kitty("drive", "--target", target, *form, speaks=False, columns=1000) as screen:
        begun = screen.wait_for("stopped")
        begun = screen.wait_for("armed", after=begun)
        screen.press(" ")
        if not form:
            screen.wait_for("52;c;cm0gLXJm", after=begun)
        screen.press("x")
        assert screen.process.wait(20) == 0
        drawn = screen.read()
    assert "cm0gLXJm" in drawn, "the robot's words"
    assert not NEVER & set(OURS.sub("", drawn))


def test_an_event_of_the_far_future_is_shown(target: str) -> None:
    done = robotctl_process("--target", target, "events", "--clients")
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) == len(event_pb2.Event.DESCRIPTOR.oneofs_by_name["payload"].fields)


@pytest.mark.parametrize("form", [(), ("--json",)], ids=["line", "json"])
def test_a_refusal_is_text_as_well(form: tuple[str, ...]) -> None:
    double = GatewayDouble()
    double.failures.append((grpc.StatusCode.FAILED_PRECONDITION, "no\x1b]0;owned\x07\u202e\u009b2J"))
    with serving(double) as port:
        done = robotctl("--target", f"127.0.0.1:{port}", *form, "status")
    assert done.returncode == 1
    assert not NEVER & set(done.stderr)
