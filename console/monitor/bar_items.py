"""Texts of the bar above the picture: health, battery, link, age of the picture, mode, time. Pure."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime

from console.client.results import Freshness, Sample
from console.monitor.link import LinkState, LinkText
from console.monitor.monitor_state import MonitorState
from console.presentation.formatting import UNKNOWN, joined, quantity, zone_text
from console.presentation.health import active_severities, health_counts, health_style, health_summary
from console.presentation.own_stream import OwnStream
from console.presentation.picture_age import PictureAge
from console.presentation.severity_style import SeverityStyle
from console.presentation.value_style import (
    BATTERY_FAULTS,
    LOSS_PERCENT,
    NETWORK_FAULTS,
    PICTURE_AGE_MS,
    ROUND_TRIP_MS,
    WIFI_DBM,
    of_battery,
    with_faults,
    worst,
)


@dataclass(frozen=True, slots=True)
class BarItem:
    """One item of the bar.

    Args:
        word: the value.
        detail: the line below it.
        style: how good the value is.
        tip: the whole text; empty where word and detail say all.
    """

    word: str
    detail: str
    style: SeverityStyle = SeverityStyle.QUIET
    tip: str = ""


@dataclass(frozen=True, slots=True)
class BatteryItem(BarItem):
    """The item of the battery.

    Args:
        charge_percent: what the gauge shows; None while it is unknown.
    """

    charge_percent: float | None = None


def health_item(state: MonitorState, now_s: float) -> BarItem:
    """Returns the health with the counts of errors and warnings."""
    if state.snapshot is None:
        return BarItem("not known", "no status yet")
    status, health = state.snapshot.status, state.snapshot.status.health
    summary = health_summary(status)
    if state.outdated(now_s):
        return BarItem("not known", joined(f"last known: {health.state.value.upper()}", summary))
    detail = joined(health_counts(status.faults), health.summary)
    style = health_style(health.state, active_severities(status.faults))
    return BarItem(health.state.value.upper(), detail, style, summary)


def battery_item(state: MonitorState, now_s: float) -> BatteryItem:
    """Returns the charge of the traction battery."""
    if state.snapshot is None:
        return BatteryItem(UNKNOWN, "battery")
    battery = state.snapshot.status.platform.power.lipo_battery
    charge = battery.charge_percent if battery.available else None
    if not battery.available or battery.present is False:
        return BatteryItem(UNKNOWN, "no battery")
    found = with_faults(of_battery(battery), state.snapshot.status.faults, BATTERY_FAULTS)
    word = quantity(charge, "%", 0)
    if _is_stale(battery, state, now_s):
        return BatteryItem(word, "STALE", SeverityStyle.WARNING, charge_percent=charge)
    charging = "charging" if battery.charging else ""
    voltage = "" if battery.voltage_v is None else quantity(battery.voltage_v, "V")
    detail = joined(found.word, charging, voltage) or "battery"
    return BatteryItem(word, detail, found.style, charge_percent=charge)


def link_item(state: MonitorState, link: LinkText, now_s: float, stream: OwnStream | None = None) -> BarItem:
    """Returns the connection's state; while connected with round trip, loss of the video, and Wi-Fi.

    The loss is that of this window's stream where it is known, else the largest one of all viewers.
    """
    if state.link.state is not LinkState.CONNECTED or state.snapshot is None:
        return BarItem(link.mark, link.detail, link.style)
    status = state.snapshot.status
    measured, network = status.preview.measured, status.platform.network
    loss = None if _is_stale(measured, state, now_s) else measured.worst_loss_percent
    whose = "of all viewers' video, the largest"
    if stream and stream.loss_percent is not None:
        loss, whose = stream.loss_percent, "of the video here"
    signal = None if _is_stale(network, state, now_s) else network.wifi_signal_dbm
    wifi = with_faults(WIFI_DBM.judge(signal), status.faults, NETWORK_FAULTS)
    found = worst((ROUND_TRIP_MS.judge(state.link.answer_ms), LOSS_PERCENT.judge(loss), wifi))
    parts = (
        found.word,
        quantity(state.link.answer_ms, "ms", 0),
        "" if loss is None else f"loss {quantity(loss, '%')}",
        "" if signal is None else f"Wi-Fi {signal} dBm",
    )
    tip = f"{link.mark}: round trip to the gateway, packet loss {whose}, signal of the robot's Wi-Fi"
    return BarItem(link.mark, " \u00b7 ".join(filter(None, parts)), found.style, tip)


def picture_item(
    age: PictureAge | None,
    frozen_s: float | None,
    stream: OwnStream | None = None,
    *,
    others_ms: float | None = None,
) -> BarItem:
    """Returns the age of the picture on the screen, and of a late one where most of it comes from.

    Args:
        age: the reading of this window; None without one.
        frozen_s: how long the picture has been frozen; None while it is live, or without a picture.
        stream: how the pictures of this window come; None before they do.
        others_ms: the largest age that another viewer reports; it is no judgement of the picture here.
    """
    delivery = stream.text if stream else ""
    if frozen_s is not None:
        return BarItem(f"> {quantity(frozen_s, 's')}", "picture frozen", SeverityStyle.BAD, delivery)
    if age is None and others_ms is None:
        return BarItem(UNKNOWN, "picture age", tip=joined("the age is not known", delivery))
    if age is None:
        tip = joined("the age of the picture here is not known", delivery)
        return BarItem(quantity(others_ms, "ms", 0), "oldest of other viewers", tip=tip)
    found = PICTURE_AGE_MS.judge(age.age_ms)
    error = "" if age.error_ms is None else f" \u00b1 {math.ceil(age.error_ms)}"
    what = f"picture: {age.cause}" if found.word and age.cause else "picture age"
    longest = f"longest part: {age.cause}" if age.cause else ""
    word, detail = f"{age.age_ms:.0f}{error} ms", joined(found.word, what)
    return BarItem(word, detail, found.style, joined(longest, delivery))


def reported_age_ms(state: MonitorState, now_s: float) -> float | None:
    """Returns the largest age of a picture that any of the robot's viewers reports; None without a report."""
    if state.snapshot is None:
        return None
    measured = state.snapshot.status.preview.measured
    return None if _is_stale(measured, state, now_s) else measured.worst_picture_age_ms


def mode_item(state: MonitorState, now_s: float) -> BarItem:
    """Returns the robot's mode; a mode that is published on change only stays valid when stale."""
    mode = state.snapshot.status.mission.mode if state.snapshot else None
    if mode and state.outdated(now_s):
        return BarItem(mode, "last known", tip="The robot does not answer: this was its mode")
    return BarItem(mode or UNKNOWN, "mode")


def clock_item(clock: Callable[[], datetime] = lambda: datetime.now().astimezone()) -> BarItem:
    """Returns this computer's time and its zone."""
    now = clock()
    return BarItem(f"{now:%H:%M:%S}", zone_text(now))


def _is_stale(sample: Sample, state: MonitorState, now_s: float) -> bool:
    return sample.freshness is Freshness.STALE or state.outdated(now_s)
