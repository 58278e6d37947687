"""How the connection to the fleet reads, in the terminal and in the window."""

from typing import Any

from console.client.mapping.methods import GET_SYSTEM_STATUS
from console.client.results import RecordingCopy, RecordingCopyState
from console.presentation.cloud import copy_text
from console.presentation.severity_style import SeverityStyle
from console.presentation.status_row import Row, View
from console.presentation.status_table import table_rows
from omniseer.gateway.v1 import cloud_pb2, recording_pb2
from tests.support.gateway_double import healthy_status


def row(*, compact: bool = False, **cloud: Any) -> Row | None:
    message = healthy_status()
    if cloud:
        message.cloud.MergeFrom(cloud_pb2.CloudStatus(robot="lab-1", fleet="lab", **cloud))
    status = GET_SYSTEM_STATUS.decode(message.SerializeToString())
    rows = table_rows(View(status, compact=compact))
    return next((each for each in rows if each.label.lower() == "fleet"), None)


def test_a_robot_without_a_fleet_has_no_row() -> None:
    assert row() is None


def test_a_robot_that_is_connected() -> None:
    found = row(state=cloud_pb2.CLOUD_STATE_CONNECTED, state_age_ms=61_000, last_sent_age_ms=2000)
    assert found == Row(
        "fleet", "CONNECTED", SeverityStyle.GOOD, "lab-1, fleet lab, last sent 2.0 s ago", "1 min 01 s"
    )
    assert row(compact=True, state=cloud_pb2.CLOUD_STATE_CONNECTED) == Row(
        "Fleet", "CONNECTED", SeverityStyle.GOOD, ""
    )


def test_one_that_is_not_says_what_waits_and_why() -> None:
    found = row(
        state=cloud_pb2.CLOUD_STATE_OFFLINE,
        outbox_events=12,
        events_dropped=1,
        uploads_waiting=2,
        uploads_paused="not charging",
        last_error="no route",
    )
    assert found
    assert (found.mark, found.style) == ("OFFLINE", SeverityStyle.WARNING)
    assert found.text == (
        "lab-1, fleet lab, 12 events to send, 1 event dropped, 2 recordings to copy, not charging, no route"
    )


def test_recordings_that_find_no_place_in_the_queue() -> None:
    found = row(state=cloud_pb2.CLOUD_STATE_CONNECTED, uploads_waiting=1000, uploads_left_out=12)
    assert found
    assert found.text == "lab-1, fleet lab, 1000 recordings to copy and 12 more without a place"


def test_a_copy_on_its_way() -> None:
    uploading: dict[str, Any] = {
        "state": cloud_pb2.CLOUD_STATE_CONNECTED,
        "uploads_waiting": 1,
        "uploading_id": "a",
        "uploading": recording_pb2.RecordingCopy(
            state=recording_pb2.RECORDING_COPY_STATE_UPLOADING, bytes_done=340
        ),
        "uploading_size": 1000,
        "upload_bytes_per_s": 2_000_000,
    }
    found, short = row(**uploading), row(compact=True, **uploading)
    assert found
    assert short
    assert found.text == "lab-1, fleet lab, 1 recording to copy, a uploading 34 %, 2.0 MB/s"
    assert short.text == "1 recording to copy, uploading 34 %"


def test_the_copy_of_a_recording() -> None:
    def text(state: RecordingCopyState, done: int = 0, whole: int = 0) -> str:
        return copy_text(RecordingCopy(state=state, reason="", bytes_done=done), whole)

    assert text(RecordingCopyState.UNKNOWN) == ""
    assert text(RecordingCopyState.UPLOADING) == "uploading"
    assert text(RecordingCopyState.UPLOADING, 2000, 1000) == "uploading 100 %"
    assert text(RecordingCopyState.VERIFIED, 1000, 1000) == "verified"
