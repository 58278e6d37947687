"""Texts of the bar: at a glance, by value and by age."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone

import pytest

from console.client import Unreachable
from console.monitor.bar_items import (
    BarItem,
    battery_item,
    clock_item,
    health_item,
    link_item,
    mode_item,
    picture_item,
    reported_age_ms,
)
from console.monitor.link import Link, LinkState, link_text
from console.monitor.monitor_state import MonitorState
from console.presentation.own_stream import OwnStream
from console.presentation.picture_age import PictureAge
from console.presentation.severity_style import SeverityStyle
from omniseer.gateway.v1 import overlay_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.snapshots import NOW_S, heard, snapshot

EMPTY = MonitorState(Link(state=LinkState.CONNECTING, since_s=0))


def troubled(made: overlay_pb2.OverlaySnapshot) -> None:
    health = made.status.health
    health.state, health.summary = states.ROBOT_HEALTH_DEGRADED, "odometry stopped coming"
    for number, severity in enumerate((3, 3, 2)):
        made.status.faults.add(id=str(number), severity=severity, active=True)
    made.status.faults.add(id="gone", severity=3, active=False)


def test_the_health_begins_with_the_counts() -> None:
    item = health_item(heard(snapshot(troubled)), NOW_S)
    assert (item.word, item.style) == ("DEGRADED", SeverityStyle.WARNING)
    assert item.detail == "2 errors, 1 warning, odometry stopped coming"


def test_no_tick_stands_beside_an_error_that_the_health_ignores() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.faults.add(id="preview.faulted", severity=3, active=True)

    item = health_item(heard(snapshot(change)), NOW_S)
    assert (item.word, item.style) == ("OK", SeverityStyle.WARNING)
    assert item.detail.startswith("1 error")


def test_a_silent_robots_health_is_not_known() -> None:
    item = health_item(heard(), NOW_S + 60)
    assert (item.word, item.style) == ("not known", SeverityStyle.QUIET)
    assert "last known: OK" in item.detail
    assert health_item(EMPTY, NOW_S).word == "not known"


def with_charge(percent: float) -> MonitorState:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        battery = made.status.platform.power.lipo_battery
        battery.percentage, battery.voltage, battery.voltage_available = percent, 12.4, True

    return heard(snapshot(change))


def test_the_battery_is_coloured_by_its_charge_and_by_its_age() -> None:
    good, low = battery_item(with_charge(78), NOW_S), battery_item(with_charge(12), NOW_S)
    assert (good.word, good.detail, good.style) == ("78 %", "12.4 V", SeverityStyle.GOOD)
    assert (low.word, low.detail, low.style) == ("12 %", "LOW, 12.4 V", SeverityStyle.WARNING)
    assert low.charge_percent == 12
    assert battery_item(with_charge(78), NOW_S + 60).detail == "STALE"


def test_battery_and_link_are_no_better_than_the_robots_own_faults() -> None:
    """Its limits may be stricter than the defaults."""

    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.platform.power.lipo_battery.percentage = 25
        network = made.status.platform.network
        network.available, network.connected = True, True
        network.wifi_signal_available, network.wifi_signal_dbm = True, -60
        for fault_id in ("battery.low", "platform.wifi"):
            made.status.faults.add(id=fault_id, severity=2, active=True)

    state = heard(snapshot(change))
    low, link = battery_item(state, NOW_S), link_item(state, link_text(state.link, "lab", NOW_S), NOW_S)
    assert (low.word, low.style) == ("25 %", SeverityStyle.WARNING)
    assert low.detail.startswith("LOW")
    assert (link.style, link.detail.startswith("WEAK")) == (SeverityStyle.WARNING, True)


def test_a_robot_without_a_battery_says_so() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.platform.power.lipo_battery.available = False

    item = battery_item(heard(snapshot(change)), NOW_S)
    assert (item.word, item.detail, item.charge_percent) == ("-", "no battery", None)


def test_the_link_has_round_trip_loss_and_wifi() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        measured, network = made.status.preview.measured, made.status.platform.network
        measured.available, measured.worst_loss_percent = True, 0.4
        network.available, network.connected = True, True
        network.wifi_signal_available, network.wifi_signal_dbm = True, -78

    state = heard(snapshot(change))
    item = link_item(state, link_text(state.link, "lab", NOW_S), NOW_S)
    assert item.word == "connected"
    assert item.detail == "WEAK \u00b7 3 ms \u00b7 loss 0.4 % \u00b7 Wi-Fi -78 dBm"
    assert item.style is SeverityStyle.WARNING


def test_the_loss_is_that_of_this_windows_stream_where_it_is_known() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.preview.measured.available, made.status.preview.measured.worst_loss_percent = True, 9.0

    state = heard(snapshot(change))
    link = link_text(state.link, "lab", NOW_S)
    known = link_item(state, link, NOW_S, OwnStream("direct", loss_percent=0.4))
    assert "loss 0.4 %" in known.detail
    assert "packet loss of the video here" in known.tip
    unknown = link_item(state, link, NOW_S, OwnStream("SRT latency"))
    assert "loss 9.0 %" in unknown.detail
    assert "of all viewers" in unknown.tip


def test_the_tip_of_the_picture_has_cause_and_delivery() -> None:
    stream = OwnStream("direct, round trip 20 ms, rejoined 2x")
    assert picture_item(PictureAge(180, cause="link"), None, stream).tip == (
        "longest part: link, direct, round trip 20 ms, rejoined 2x"
    )
    assert picture_item(None, None, stream).tip.startswith("the age is not known, direct")
    assert picture_item(None, 2.0, stream).tip == stream.text


def test_a_lost_link_says_what_is_the_matter() -> None:
    link = Link(state=LinkState.LOST, since_s=NOW_S - 5, error=Unreachable("gone"), attempts=1)
    item = link_item(replace(heard(), link=link), link_text(link, "lab", NOW_S), NOW_S)
    assert (item.word, item.detail, item.style) == ("unreachable", "for 5.0 s", SeverityStyle.BAD)


@pytest.mark.parametrize(
    ("age", "frozen_s", "word", "style"),
    [
        (None, None, "-", SeverityStyle.QUIET),
        (PictureAge(118), None, "118 ms", SeverityStyle.GOOD),
        (PictureAge(118, 4.2), None, "118 \u00b1 5 ms", SeverityStyle.GOOD),
        (PictureAge(118, 0.4), None, "118 \u00b1 1 ms", SeverityStyle.GOOD),
        (PictureAge(118, 0.0), None, "118 \u00b1 0 ms", SeverityStyle.GOOD),
        (PictureAge(150), None, "150 ms", SeverityStyle.WARNING),
        (PictureAge(400), None, "400 ms", SeverityStyle.BAD),
        (PictureAge(118), 1.9, "> 1.9 s", SeverityStyle.BAD),
    ],
)
def test_the_age_of_the_picture(
    age: PictureAge | None, frozen_s: float | None, word: str, style: SeverityStyle
) -> None:
    item = picture_item(age, frozen_s)
    assert (item.word, item.style) == (word, style)


@pytest.mark.parametrize(
    ("age", "detail"),
    [
        (PictureAge(149, cause="link"), "picture age"),
        (PictureAge(150), "LATE, picture age"),
        (PictureAge(150, cause="link"), "LATE, picture: link"),
        (PictureAge(400, cause="encoder"), "LATE, picture: encoder"),
    ],
)
def test_a_late_picture_says_what_takes_longest(age: PictureAge, detail: str) -> None:
    assert picture_item(age, None).detail == detail


def test_the_age_of_another_viewers_picture_is_no_word_about_the_one_here() -> None:
    stream = OwnStream("SRT latency")
    item = picture_item(None, None, stream, others_ms=18)
    assert (item.word, item.detail, item.style) == ("18 ms", "oldest of other viewers", SeverityStyle.QUIET)
    assert item.tip.endswith("not known, SRT latency")
    assert picture_item(None, None, others_ms=900).style is SeverityStyle.QUIET
    assert picture_item(PictureAge(118), None, others_ms=900) == picture_item(PictureAge(118), None)
    assert picture_item(None, 2.0, others_ms=18) == picture_item(None, 2.0)


def test_the_report_of_other_viewers_is_read() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        measured = made.status.preview.measured
        measured.available, measured.worst_picture_age_ms = True, 118

    assert reported_age_ms(EMPTY, NOW_S) is None
    assert reported_age_ms(heard(), NOW_S) is None
    assert reported_age_ms(heard(snapshot(change)), NOW_S) == 118
    assert reported_age_ms(heard(snapshot(change)), NOW_S + 60) is None, "the robot is silent"


def test_the_mode_stays_valid() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.mission.available, made.status.mission.stale = True, True
        made.status.mission.mode = "manual"

    assert mode_item(heard(snapshot(change)), NOW_S) == BarItem("manual", "mode")
    assert mode_item(EMPTY, NOW_S).word == "-"


def test_the_mode_of_a_silent_robot_is_the_last_known_one() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.mission.available, made.status.mission.mode = True, "manual"

    item = mode_item(heard(snapshot(change)), NOW_S + 60)
    assert (item.word, item.detail, item.style) == ("manual", "last known", SeverityStyle.QUIET)


@pytest.mark.parametrize(
    ("zone", "detail"),
    [(UTC, "UTC+00:00"), (timezone(timedelta(hours=-9, minutes=-30)), "UTC-09:30")],
)
def test_the_clock_names_its_zone(zone: timezone, detail: str) -> None:
    item = clock_item(lambda: datetime(2026, 1, 2, 3, 4, 5, tzinfo=zone))
    assert (item.word, item.detail) == ("03:04:05", detail)
