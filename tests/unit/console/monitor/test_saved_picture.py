"""The document beside a saved picture."""

import json
from datetime import UTC, datetime

import pytest

from console.monitor.link import Link, LinkState
from console.monitor.monitor_state import MonitorState
from console.monitor.saved_picture import file_stem, picture_record
from console.presentation.picture_age import PictureAge
from omniseer.gateway.v1 import overlay_pb2
from tests.support.snapshots import NOW_S, heard, snapshot

AT = datetime(2026, 1, 2, 3, 4, 5, 678_900, tzinfo=UTC)


def test_it_has_the_status_of_the_moment() -> None:
    record = picture_record(heard(), NOW_S + 1, AT, (1280, 720), PictureAge(118, 4.0))
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert record["saved_at"] == "2026-01-02T03:04:05.678+00:00"
    assert record["picture"] == {
        "width_px": 1280,
        "height_px": 720,
        "age": {"age_ms": 118, "error_ms": 4.0, "cause": ""},
    }
    assert (record["connected"], record["status_age_ms"]) == (True, 1000)
    assert record["status"]["gateway_name"] == "lab-1"
    assert record["detections"]["available"] is False


def test_it_never_has_the_passphrase() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.preview.endpoint.passphrase = "correct horse"
        made.status.preview.endpoint.host = "127.0.0.1"

    record = picture_record(heard(snapshot(change)), NOW_S, AT, (2, 2), None)
    assert record["status"]["preview"]["endpoint"]["host"] == "127.0.0.1"
    assert "correct horse" not in json.dumps(record)


def test_a_picture_without_a_status_says_so() -> None:
    empty = MonitorState(Link(state=LinkState.CONNECTING, since_s=0))
    record = picture_record(empty, NOW_S, AT, (2, 2), None)
    assert (record["connected"], record["status"], record["status_age_ms"]) == (False, None, None)


@pytest.mark.parametrize(
    ("robot", "stem"),
    [
        ("lab-1", "lab-1-20260102-030405-678"),
        ("../../etc/passwd", "etc-passwd-20260102-030405-678"),
        ("\u00fc\0/", "robot-20260102-030405-678"),
        ("", "robot-20260102-030405-678"),
    ],
)
def test_a_robots_name_leads_nowhere_else(robot: str, stem: str) -> None:
    assert file_stem(robot, AT) == stem
