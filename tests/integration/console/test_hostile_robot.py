"""robotctl and a robot, or what pretends to be one, that sends what no gateway sends."""

import json
from collections.abc import Iterator
from typing import Any

import grpc
import pytest

from omniseer.gateway.v1 import event_pb2, states_pb2
from omniseer.gateway.v1.robot_gateway_pb2 import SubscribeEventsResponse, WatchSystemStatusResponse
from tests.support.control_characters import CONTROL_CHARACTERS, change_texts
from tests.support.filled import fields_of, fill
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.robotctl import robotctl, robotctl_process

NEVER = set(CONTROL_CHARACTERS) - {"\n"}
LATEST = 2**63 - 1
HOSTILE = f"{CONTROL_CHARACTERS}\x1b]52;c;cm0gLXJm\x07"


class HostileRobot(GatewayDouble):
    """Every text is full of control characters, and every clock is far ahead."""

    def __init__(self) -> None:
        super().__init__()
        for message in (self.status, self.overlay, self.info):
            message.Clear()
            fill(message)
            change_texts(message, lambda _text: HOSTILE)
        self.info.configuration_json = json.dumps({"name": CONTROL_CHARACTERS})
        self.info.wall_clock_unix_ms = LATEST
        self.status.preview.state = states_pb2.PREVIEW_RUNNING

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


@pytest.fixture
def target() -> Iterator[str]:
    with serving(HostileRobot()) as port:
        yield f"127.0.0.1:{port}"


COMMANDS = [
    ("status",),
    ("watch", "--count", "1"),
    ("overlay",),
    ("info",),
    ("events",),
    ("doctor",),
    ("preview", "on", "--wait", "0"),
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
