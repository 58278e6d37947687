"""The gates, in words."""

from datetime import time
from typing import Any

import pytest
from pydantic import ValidationError

from bridge.uploads.config import UploadSettings
from bridge.uploads.gates import Conditions, closed

NOON = Conditions(interface="wlan0", local_time=time(12, 0), charging=False)


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({}, ""),
        ({"interfaces": ("wl*", "eth0")}, ""),
        (
            {"interfaces": ("eth*",)},
            "the store is reached through wlan0; uploads are allowed through eth*",
        ),
        ({"hours": ("08:00-12:01",)}, ""),
        ({"hours": ("08:00-12:00",)}, "it is 12:00; uploads are allowed at 08:00-12:00"),
        ({"hours": ("22:00-06:00", "12:00-13:00")}, ""),
        (
            {"only_while_charging": True},
            "the robot is not charging; uploads are allowed only while it is",
        ),
    ],
)
def test_what_is_closed_says_why(settings: dict[str, Any], reason: str) -> None:
    assert closed(UploadSettings(**settings), NOON) == reason


@pytest.mark.parametrize(("hour", "is_open"), [(21, False), (22, True), (0, True), (5, True), (6, False)])
def test_hours_may_last_over_midnight(hour: int, is_open: bool) -> None:
    settings = UploadSettings(hours=("22:00-06:00",))
    now = Conditions(interface="", local_time=time(hour, 0), charging=None)
    assert (closed(settings, now) == "") is is_open


def test_what_is_not_known_closes_a_gate() -> None:
    unknown = Conditions(interface="", local_time=time(12, 0), charging=None)
    assert "route to the store is not known" in closed(UploadSettings(interfaces=("eth0",)), unknown)
    assert "not known whether" in closed(UploadSettings(only_while_charging=True), unknown)


@pytest.mark.parametrize(
    "settings",
    [
        {"hours": ("25:00-06:00",)},
        {"hours": ("8-12",)},
        {"interfaces": ("eth0; rm",)},
        {"max_bytes_per_s": 100},
        {"store_hosts": ("https://store",)},
        {"store_hosts": ("store.example/../bucket",)},
        {"store_hosts": ("store.example",), "insecure_store": True},
    ],
)
def test_settings_that_make_no_sense_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        UploadSettings(**settings)
