"""The gates, in words."""

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest
from pydantic import ValidationError

from bridge.config import UploadSettings
from bridge.uploads.gates import Conditions, closed
from tests.support.time_zones import local_zone

NOON = Conditions(interface="wlan0", now=datetime(2026, 7, 1, 12, 0, tzinfo=UTC), charging=False)


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
        ({"hours": ("08:00-12:00",)}, "it is 12:00 (ROBOT); uploads are allowed at 08:00-12:00"),
        ({"hours": ("22:00-06:00", "12:00-13:00")}, ""),
        (
            {"only_while_charging": True},
            "the robot is not charging; uploads are allowed only while it is",
        ),
    ],
)
def test_what_is_closed_says_why(settings: dict[str, Any], reason: str) -> None:
    with local_zone("ROBOT0"):
        assert closed(UploadSettings(**settings), NOON) == reason


def test_what_is_not_known_closes_a_gate() -> None:
    unknown = replace(NOON, interface="", charging=None)
    assert "route to the store is not known" in closed(UploadSettings(interfaces=("eth0",)), unknown)
    assert "not known whether" in closed(UploadSettings(only_while_charging=True), unknown)


@pytest.mark.parametrize(
    "settings",
    [
        {"hours": ("25:00-06:00",)},
        {"hours": ("8-12",)},
        {"time_zone": "Berlin-1"},
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
