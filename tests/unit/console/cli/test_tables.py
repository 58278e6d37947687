"""What the tables and lines for people say; colour never says anything alone."""

import io

import pytest
from rich.console import Console, RenderableType

from console.cli.tables import overlay_view, status_view
from console.client.mapping.methods import GET_OVERLAY_SNAPSHOT, GET_SYSTEM_STATUS
from console.client.results import SystemStatus
from console.presentation.severity_style import SeverityStyle
from console.presentation.status_line import status_line
from console.presentation.status_row import View
from console.presentation.status_table import table_rows
from omniseer.gateway.v1 import overlay_pb2
from omniseer.gateway.v1 import states_pb2 as states
from omniseer.gateway.v1.fault_pb2 import FAULT_SEVERITY_ERROR
from omniseer.gateway.v1.source_pb2 import (
    SOURCE_STATE_RECEIVING,
    SOURCE_STATE_STALE,
    SOURCE_STATE_WAITING,
)
from omniseer.gateway.v1.system_status_pb2 import SystemStatus as StatusMessage
from tests.support.gateway_double import healthy_status


def printed(view: RenderableType, width: int = 160) -> str:
    console = Console(file=io.StringIO(), width=width, highlight=False, markup=False)
    console.print(view)
    text = console.file
    assert isinstance(text, io.StringIO)
    return text.getvalue()


def decoded(message: StatusMessage) -> SystemStatus:
    return GET_SYSTEM_STATUS.decode(message.SerializeToString())


def test_a_healthy_robot() -> None:
    text = printed(status_view(decoded(healthy_status()), "robot:50051"))
    for part in (
        "lab-1",
        "robot:50051",
        "1.2.3",
        "OK",
        "robot healthy",
        "0.50 m/s",
        "turning +0.30 rad/s",
        "12 ms",
    ):
        assert part in text
    assert "evaluated 29.5 fps" in text
    assert "78 %" in text
    assert "STALE" not in text


def test_stale_and_missing_are_words() -> None:
    message = healthy_status()
    message.vision.stale, message.vision.age_ms = True, 3400
    message.health.odom_available = False
    rows = {row.label: row for row in table_rows(View(decoded(message)))}
    assert (rows["vision"].mark, rows["vision"].age) == ("STALE", "3.4 s")
    assert (rows["motion"].mark, rows["motion"].text) == ("no data", "")
    line = status_line(decoded(message))
    assert "vision STALE 29.5 fps (3.4 s)" in line
    assert "motion no data" in line


def test_what_the_robot_never_reports_has_no_line() -> None:
    labels = [row.label for row in table_rows(View(decoded(healthy_status())))]
    assert labels == ["health", "motion", "vision", "preview", "battery"]


def test_everything_a_gateway_can_report_has_a_line() -> None:
    message = healthy_status()
    message.platform.compute.available = True
    message.platform.compute.thermal_throttled_available = message.platform.compute.thermal_throttled = True
    message.platform.network.available = message.platform.network.connected = True
    message.platform.network.interface_name = "wlan0"
    message.platform.power.onboard_battery.available = True
    message.effective_command.available = True
    message.effective_command.active_source = "keyboard"
    message.teleop.state, message.teleop.enabled = states.TELEOP_ENABLED, True
    text = printed(status_view(decoded(message), "robot:50051"))
    for part in ("throttled by heat", "wlan0, connected", "not installed", "from keyboard", "ENABLED"):
        assert part in text


def test_a_faulted_preview_says_why_and_a_fallback_says_what_was_preferred() -> None:
    message = healthy_status()
    message.preview.state, message.preview.last_error = states.PREVIEW_FAULTED, "camera unplugged"
    message.preview.encoder.name, message.preview.encoder.wanted = "x264", "mpp-h265"
    message.preview.encoder.fallback_reason = "/dev/mpp_service is missing"
    rows = table_rows(View(decoded(message)))
    assert any(row.style is SeverityStyle.BAD and row.text == "camera unplugged" for row in rows)
    assert any(row.text == "preferred mpp-h265, /dev/mpp_service is missing" for row in rows)
    assert "preview faulted (camera unplugged)" in status_line(decoded(message))


def test_a_fallback_that_is_a_fault_is_said_once() -> None:
    message = healthy_status()
    message.preview.encoder.name, message.preview.encoder.wanted = "x264", "mpp-h265"
    message.preview.encoder.fallback_reason = "/dev/mpp_service is missing"
    other = message.faults.add(id="preview.failed", severity=FAULT_SEVERITY_ERROR, active=True)
    fault = message.faults.add(id="preview.fallback", message="x264 instead of mpp-h265")
    assert rows_of_the_fallback(message) == ["fallback"], "the fault is cleared, the fallback is not"
    fault.active, other.active = True, False
    assert rows_of_the_fallback(message) == ["fault"]


def rows_of_the_fallback(message: StatusMessage) -> list[str]:
    """Where the table says that the preferred encoder does not run."""
    rows = table_rows(View(decoded(message)))
    return [row.label or row.mark for row in rows if "mpp-h265" in row.text and row.mark != "cleared"]


def test_faults_stand_right_below_health_and_say_what_to_do() -> None:
    message = healthy_status()
    message.faults.add(
        id="platform.disk",
        severity=FAULT_SEVERITY_ERROR,
        message="the disk is nearly full",
        remedy="make room",
        active=True,
        age_ms=65_000,
    )
    message.faults.add(
        id="odometry.stale", message="odometry stopped coming", age_ms=9000, cleared_age_ms=500
    )
    _, disk, odometry = table_rows(View(decoded(message)))[:3]
    assert (disk.mark, disk.style, disk.age) == ("error", SeverityStyle.BAD, "1 min 05 s")
    assert disk.text == "the disk is nearly full -> make room"
    assert status_line(decoded(message)).endswith("  1 fault (platform.disk)")
    assert (odometry.mark, odometry.text, odometry.age) == ("cleared", "odometry stopped coming", "500 ms")


def test_a_source_has_a_line_only_when_nothing_else_reports_it() -> None:
    message = healthy_status()
    message.sources.add(name="odometry", state=SOURCE_STATE_RECEIVING, available=True)
    message.sources.add(name="battery", state=SOURCE_STATE_WAITING, detail="no battery")
    message.sources.add(name="vision", state=SOURCE_STATE_STALE, detail="vision stopped coming")
    message.faults.add(id="vision.stale", message="vision stopped coming", active=True)
    rows = [row for row in table_rows(View(decoded(message))) if row.label == "source"]
    assert [(row.mark, row.text) for row in rows] == [("waiting", "no battery")]


def test_a_running_preview_shows_its_figures_and_where_to_watch() -> None:
    message = healthy_status()
    message.preview.state = states.PREVIEW_RUNNING
    message.preview.endpoint.uri = "srt://10.0.0.7:7100"
    message.preview.target_bitrate_kbps = 2500
    measured = message.preview.measured
    measured.available, measured.fps, measured.bitrate_kbps, measured.viewer_count = True, 30, 2480, 1
    text = printed(status_view(decoded(message), "robot:50051"))
    assert "srt://10.0.0.7:7100" in text
    assert "2.48 Mbit/s of 2.50 Mbit/s, 30.0 fps, 1 viewer" in text
    assert "round trip" not in text, "none was measured"
    assert "preview running 30.0 fps 2.48 Mbit/s 1 viewer" in status_line(decoded(message))
    assert "SRT latency" not in text, "no viewer reports it"
    measured.srt_latency_viewer_count, measured.most_packets_given_up = 1, 7
    text = printed(status_view(decoded(message), "robot:50051"))
    assert "1 viewer, 1 viewer at SRT latency, 7 packets given up" in " ".join(text.split())


@pytest.mark.parametrize("width", [40, 80, 200])
def test_no_word_is_lost_on_a_narrow_screen(width: int) -> None:
    message = healthy_status()
    message.health.summary = "the left rear wheel encoder has been silent since the last reboot"
    text = " ".join(printed(status_view(decoded(message), "r:1"), width).split())
    for word in message.health.summary.split():
        assert word in text


def test_texts_of_the_robot_are_no_markup() -> None:
    message = healthy_status()
    message.health.summary = "[bold]not bold[/bold] [/]"
    assert "[bold]not bold[/bold] [/]" in printed(status_view(decoded(message), "r:1"))


def test_overlay_lists_objects_and_events() -> None:
    message = overlay_pb2.OverlaySnapshot(status=healthy_status())
    found = message.detections
    found.available, found.age_ms, found.detection_count = True, 33, 5
    found.source_width_px, found.source_height_px = 1280, 720
    found.detections.add(class_name="person", score=0.91, bbox_center_x_px=640, bbox_center_y_px=360)
    found.detections.add(class_id=7)
    message.events.add(sequence=4, age_ms=65_000, message="preview running")
    text = printed(overlay_view(GET_OVERLAY_SNAPSHOT.decode(message.SerializeToString()), "r:1"))
    for part in ("5 in a frame of 1280x720", "the first 2 of them", "person", "0.91", "class 7"):
        assert part in text
    assert "#4" in text
    assert "1 min 05 s ago" in text


def test_health_counts_active_errors_and_warnings() -> None:
    message = healthy_status()
    for severity, active in (("ERROR", True), ("ERROR", True), ("WARNING", True), ("ERROR", False)):
        message.faults.add(severity=f"FAULT_SEVERITY_{severity}", active=active, message="broken")
    health = table_rows(View(decoded(message)))[0]
    assert (health.label, health.text) == ("health", "robot healthy (2 errors, 1 warning)")


@pytest.mark.parametrize("severity", ["WARNING", "ERROR"])
def test_health_is_not_green_above_a_fault_that_it_ignores(severity: str) -> None:
    message = healthy_status()
    assert table_rows(View(decoded(message)))[0].style is SeverityStyle.GOOD
    fault = message.faults.add(id="preview.failed", severity=f"FAULT_SEVERITY_{severity}", active=True)
    health = table_rows(View(decoded(message)))[0]
    assert (health.mark, health.style) == ("OK", SeverityStyle.WARNING)
    fault.active = False
    assert table_rows(View(decoded(message)))[0].style is SeverityStyle.GOOD


def test_a_title_is_plain_text_of_bounded_length() -> None:
    message = healthy_status()
    message.numbers.add(title="[/red] load", available=True, value=1e300, decimals=4_000_000_000)
    message.numbers.add(title="x" * 10_000, available=True, value=0.125, decimals=4_000_000_000)
    message.texts.add(title="[bold]arm", available=True, text="[/] jammed")
    console = Console(file=io.StringIO(), width=160)
    console.print(status_view(decoded(message), "robot:50051"))
    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()
    assert any("[/red] load" in line and "1e+300" in line for line in lines)
    assert any("[bold]arm" in line and "[/] jammed" in line for line in lines)
    assert any("0.125000000" in line and "x" * 40 in line for line in lines)
    assert not any("x" * 41 in line for line in lines)
