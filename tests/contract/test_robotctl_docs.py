"""docs/robotctl.md names every key of the JSON documents, and none that is not."""

from pathlib import Path
from typing import Any

import pytest
from google.protobuf.message import Message

from common.findings import findings_json, good
from console.cli.error_report import error_as_json
from console.cli.fleet import recordings_json
from console.cli.fleet_events import item_json
from console.cli.fleet_watch import fleet_json
from console.cli.info import info_json
from console.cli.recording_tables import exported_json
from console.client import Unreachable
from console.client.exporting import ExportedRecording
from console.client.mapping.driving import drive_item
from console.client.mapping.events import event
from console.client.mapping.methods import (
    CANCEL_UPLOAD,
    DELETE_RECORDING,
    GET_GATEWAY_INFO,
    GET_OVERLAY_SNAPSHOT,
    GET_RECORDING,
    GET_SYSTEM_STATUS,
    LIST_RECORDINGS,
    RESET_STOP,
    SET_TELEOP_ENABLED,
    START_RECORDING,
    STOP_ROBOT,
    SUBSCRIBE_EVENTS,
    UPLOAD_RECORDING,
)
from console.fleet.model import ReportedState, fleet_rows
from console.fleet.values import Enrolment, ReceiptCheck, StoredRecording, Unreadable
from console.fleet.wire import answer_of, items_of, recording_of, state_of
from console.presentation.json_form import json_form
from omniseer.fleet.v1.command_pb2 import CommandResult
from omniseer.fleet.v1.event_pb2 import DroppedEvents, EventBatch, EventItem
from omniseer.fleet.v1.state_pb2 import RobotState
from omniseer.fleet.v1.upload_pb2 import StoredRecording as StoredRecordingMessage
from omniseer.gateway.v1.event_pb2 import Event, EventGap
from omniseer.gateway.v1.overlay_pb2 import OverlaySnapshot
from omniseer.gateway.v1.recording_pb2 import (
    CancelUploadResponse,
    DeleteRecordingResponse,
    GetRecordingResponse,
    ListRecordingsResponse,
    StartRecordingResponse,
    UploadRecordingResponse,
)
from omniseer.gateway.v1.robot_gateway_pb2 import (
    GetGatewayInfoResponse,
    SetTeleopEnabledResponse,
    SubscribeEventsResponse,
)
from omniseer.gateway.v1.system_status_pb2 import SystemStatus
from omniseer.gateway.v1.teleop_pb2 import DriveResponse, ResetStopResponse, StopRobotResponse
from tests.support.filled import fill
from tests.support.robotctl_docs import Type, documented, holds, leaves, spelt_out


def filled(message: Message) -> bytes:
    fill(message)
    return message.SerializeToString()


def info() -> GetGatewayInfoResponse:
    answer = GetGatewayInfoResponse()
    fill(answer)
    answer.configuration_json = "{}"
    return answer


def drive_state() -> DriveResponse:
    answer = DriveResponse()
    fill(answer.state)
    return answer


EXPORTED = ExportedRecording(folder=Path("to"), files=1, size=2, received=3, cuts=4, not_final=("a",))


def record_list() -> dict[str, Any]:
    page = LIST_RECORDINGS.decode(filled(ListRecordingsResponse()))
    return {"status": json_form(page.status), "recordings": json_form(page.recordings)}


def events_document() -> dict[str, Any]:
    """An event with every part, as no gateway sends it; a gap; an outage."""
    parts: dict[str, Any] = {}
    for field in Event.DESCRIPTOR.oneofs_by_name["payload"].fields:
        message = Event()
        fill(getattr(message, field.name))
        form = json_form(event(message))
        parts |= {key: value for key, value in form.items() if value is not None}
    gap = SUBSCRIBE_EVENTS.decode(SubscribeEventsResponse(gap=EventGap()).SerializeToString())
    return {
        "event": parts,
        "gap": json_form(gap),
        "error": error_as_json(Unreachable("gone")),
    }


def fleet_list() -> dict[str, Any]:
    # The robot's name is "first", as every text of a filled message.
    state = ReportedState(state_of("first", filled(RobotState())), 0)
    return fleet_json(fleet_rows({"first": Enrolment("first")}, {"first": state}, 1))


def fleet_events() -> dict[str, Any]:
    """An item of each kind at once, as no hub sends it."""
    dropped = DroppedEvents(first_sequence=1, last_sequence=2)
    batch = EventBatch(
        robot="r", run_id="g", first_sequence=1, last_sequence=2, items=[EventItem(dropped=dropped)]
    )
    (gap,) = items_of("fleet.r.ev.g.1", batch.SerializeToString(), 0)
    (unreadable,) = items_of("fleet.r.ev.g.1", b"?", 0)
    event = {"robot": "r", "received_unix_ms": 0, "event": events_document()["event"]}
    return {"event": event, "gap": item_json(gap)["gap"], "unreadable": item_json(unreadable)["unreadable"]}


def fleet_recordings() -> dict[str, Any]:
    stored = StoredRecordingMessage()
    fill(stored)
    found = recording_of(f"r.{stored.recording.id}", stored.SerializeToString())
    assert not isinstance(found, Unreadable)
    recording, files, _ = found
    shown = StoredRecording(
        robot="r",
        recording=recording,
        files=files,
        receipt=ReceiptCheck.VALID,
        verified_unix_ms=1,
        location="",
    )
    return recordings_json([shown, Unreadable(robot="r", problem="")])


def fleet_command() -> dict[str, Any]:
    result = CommandResult(robot="r", command_id="c")
    answer = answer_of("fleet.r.res.c", result.SerializeToString())
    return {"ok": True, **json_form(answer)}


@pytest.mark.parametrize(
    ("heading", "document"),
    [
        pytest.param(
            "status --json", json_form(GET_SYSTEM_STATUS.decode(filled(SystemStatus()))), id="status"
        ),
        pytest.param(
            "overlay --json", json_form(GET_OVERLAY_SNAPSHOT.decode(filled(OverlaySnapshot()))), id="overlay"
        ),
        pytest.param(
            "info --json", info_json(GET_GATEWAY_INFO.decode(info().SerializeToString())), id="info"
        ),
        pytest.param("events --json", events_document(), id="events"),
        pytest.param(
            "stop --json",
            {"ok": True, **json_form(STOP_ROBOT.decode(filled(StopRobotResponse())))},
            id="stop",
        ),
        pytest.param(
            "reset-stop --json",
            {"ok": True, **json_form(RESET_STOP.decode(filled(ResetStopResponse())))},
            id="reset-stop",
        ),
        pytest.param(
            "drive --disable --json",
            {"ok": True, **json_form(SET_TELEOP_ENABLED.decode(filled(SetTeleopEnabledResponse())))},
            id="drive --disable",
        ),
        pytest.param("drive --json", json_form(drive_item(drive_state())), id="drive"),
        pytest.param(
            "record start --json",
            {"ok": True, **json_form(START_RECORDING.decode(filled(StartRecordingResponse())))},
            id="record start",
        ),
        pytest.param("record list --json", record_list(), id="record list"),
        pytest.param(
            "record show --json",
            json_form(GET_RECORDING.decode(filled(GetRecordingResponse())).recording),
            id="record show",
        ),
        pytest.param(
            "record delete --json",
            {"ok": True, **json_form(DELETE_RECORDING.decode(filled(DeleteRecordingResponse())))},
            id="record delete",
        ),
        pytest.param(
            "record upload --json",
            {"ok": True, **json_form(UPLOAD_RECORDING.decode(filled(UploadRecordingResponse())))},
            id="record upload",
        ),
        pytest.param(
            "record cancel-upload --json",
            {"ok": True, **json_form(CANCEL_UPLOAD.decode(filled(CancelUploadResponse())))},
            id="record cancel-upload",
        ),
        pytest.param("record export --json", {"ok": True, **exported_json(EXPORTED)}, id="record export"),
        pytest.param("fleet list --json", fleet_list(), id="fleet list"),
        pytest.param("fleet events --json", fleet_events(), id="fleet events"),
        pytest.param("fleet recordings --json", fleet_recordings(), id="fleet recordings"),
        pytest.param("fleet get --json", {"ok": True, **exported_json(EXPORTED)}, id="fleet get"),
        pytest.param("fleet command --json", fleet_command(), id="fleet command"),
        pytest.param("doctor --json", findings_json([good("tcp", "answers")]), id="doctor"),
    ],
)
def test_the_page_lists_exactly_the_keys(heading: str, document: Any) -> None:
    holds(documented(heading), document, complete=True)


def test_the_test_would_notice() -> None:
    assert spelt_out("a.{b,c}.d") == ["a.b.d", "a.c.d"]
    assert set(leaves({"a": {"b": 1}, "c": [{"d": [], "e": 2}]})) == {"a.b", "c[].d", "c[].e"}
    said = {"a": Type("integer or null"), "b": Type('"on", "off"')}
    holds(said, {"a": None, "b": "on"}, complete=True)
    for wrong in ({"a": 1}, {"a": 1, "b": "on", "c": 2}, {"a": 1.5, "b": "on"}, {"a": True, "b": "on"}):
        with pytest.raises(AssertionError):
            holds(said, wrong, complete=True)
    with pytest.raises(AssertionError, match="neither"):
        holds(said, {"b": "neither"}, complete=False)
