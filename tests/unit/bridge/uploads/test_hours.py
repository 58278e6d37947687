"""The hours of uploads are those of the robot's zone, also where the program's own is another one."""

from collections.abc import AsyncIterator, Iterator
from datetime import UTC, datetime, tzinfo
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from bridge.cli import app
from bridge.config import BridgeSettings, UploadSettings
from bridge.doctor.judgement import hours_findings
from bridge.uploads import hours, uploads
from bridge.uploads.queue import State
from common.config import load
from common.errors import UserError
from common.findings import Verdict
from fleet.errors import HubError, HubReason
from tests.support.time_zones import known_zones, local_zone, zone_files
from tests.support.uploading import Robot, running_uploads

NIGHT = "22:00-06:00"


@pytest.fixture(autouse=True)
def zones(tmp_path: Path) -> Iterator[None]:
    with known_zones(zone_files(tmp_path / "zones")), local_zone("UTC0"):
        yield


def settings(allowed: str = NIGHT, **more: Any) -> UploadSettings:
    return UploadSettings(hours=(allowed,), **more)


def at(text: str) -> datetime:
    """An instant of UTC."""
    return datetime.fromisoformat(text).replace(tzinfo=UTC)


@pytest.mark.parametrize(
    ("zone", "instant", "are_open"),
    [
        ("UTC", "2026-07-01 21:59", False),
        ("UTC", "2026-07-01 22:00", True),
        # Two hours before UTC in summer, one in winter.
        ("Europe/Berlin", "2026-07-01 19:59", False),
        ("Europe/Berlin", "2026-07-01 20:00", True),
        ("Europe/Berlin", "2026-07-02 03:59", True),
        ("Europe/Berlin", "2026-07-02 04:00", False),
        ("Europe/Berlin", "2026-01-01 20:59", False),
        ("Europe/Berlin", "2026-01-01 21:00", True),
        # The middle of a working day, and the middle of the night by UTC.
        ("Asia/Tokyo", "2026-07-01 02:00", False),
        ("America/New_York", "2026-07-02 02:00", True),
        ("America/New_York", "2026-07-01 22:00", False),
    ],
)
def test_hours_are_those_of_the_zone_over_midnight_and_in_summer(
    zone: str, instant: str, are_open: bool
) -> None:
    assert hours.are_open(settings(time_zone=zone), at(instant)) is are_open


@pytest.mark.parametrize("rule", ["ROBOT-9", "ROBOT4"])
def test_without_a_zone_they_are_those_of_the_machine(rule: str) -> None:
    ahead = -int(rule.removeprefix("ROBOT"))
    with local_zone(rule):
        for hour in range(24):
            now = at(f"2026-07-01 {hour:02}:30")
            local = (hour + ahead) % 24
            assert hours.are_open(settings(), now) is (local >= 22 or local < 6)
            assert f"it is {local:02}:30 (ROBOT);" in hours.in_words(settings(), now)


@pytest.mark.parametrize(
    ("allowed", "instant", "are_open"),
    [
        # In Berlin 01:59 is followed by 03:00, at 01:00 UTC.
        ("02:30-06:00", "2026-03-29 00:59", False),
        ("02:30-06:00", "2026-03-29 01:00", True),
        ("01:00-02:30", "2026-03-29 00:59", True),
        ("01:00-02:30", "2026-03-29 01:00", False),
        ("02:15-02:45", "2026-03-29 00:59", False),
        ("02:15-02:45", "2026-03-29 01:00", False),
        # In Berlin 02:59 is followed by 02:00, at 01:00 UTC.
        ("02:15-02:45", "2026-10-25 00:30", True),
        ("02:15-02:45", "2026-10-25 00:45", False),
        ("02:15-02:45", "2026-10-25 01:14", False),
        ("02:15-02:45", "2026-10-25 01:15", True),
        ("02:15-02:45", "2026-10-25 01:45", False),
        (NIGHT, "2026-10-25 04:59", True),
        (NIGHT, "2026-10-25 05:00", False),
    ],
)
def test_an_hour_that_is_skipped_or_occurs_twice_is_as_the_clock_on_the_wall_has_it(
    allowed: str, instant: str, are_open: bool
) -> None:
    assert hours.are_open(settings(allowed, time_zone="Europe/Berlin"), at(instant)) is are_open


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Europe/Berln", "did you mean Europe/Berlin?"),
        ("berlin", "did you mean Europe/Berlin?"),
        ("asia/tokyo", "did you mean Asia/Tokyo?"),
        ("Europe", "expected: an IANA time zone, Europe/Berlin for example"),
        ("../zones/UTC", "expected: an IANA time zone, Europe/Berlin for example"),
        ("", "expected: an IANA time zone, Europe/Berlin for example"),
        ("x" * 65, "expected: a text of at most 64 characters"),
    ],
)
def test_a_zone_that_there_is_not_is_named_with_what_was_probably_meant(
    tmp_path: Path, name: str, said: str
) -> None:
    file = tmp_path / "bridge.yaml"
    file.write_text(f'uploads:\n  hours: ["{NIGHT}"]\n  time_zone: "{name}"\n', encoding="utf-8")
    with pytest.raises(UserError) as caught:
        load(BridgeSettings, file)
    assert f"{file}, line 3: key 'uploads.time_zone' is '{name}', expected: " in caught.value.what
    assert said in caught.value.what


def test_a_machine_without_any_zones_says_what_to_install(tmp_path: Path) -> None:
    with known_zones(tmp_path / "empty"), pytest.raises(ValueError, match="apt-get install tzdata"):
        settings(time_zone="Europe/Berlin")
    # It is needed for nothing else.
    with known_zones(tmp_path / "empty"):
        assert hours.are_open(settings(), at("2026-07-01 23:00"))


@pytest.mark.parametrize(
    ("rule", "values", "verdict", "said"),
    [
        ("UTC0", {"time_zone": "Asia/Tokyo"}, Verdict.GOOD, "it is 21:00 (Asia/Tokyo)"),
        ("UTC0", {"time_zone": "UTC"}, Verdict.GOOD, "it is 12:00 (UTC)"),
        ("ROBOT-9", {}, Verdict.GOOD, "it is 21:00 (ROBOT)"),
        ("UTC0", {}, Verdict.NOTE, "it is 12:00 (UTC)"),
    ],
)
def test_the_doctor_says_by_which_clock_and_doubts_utc_that_was_not_asked_for(
    rule: str, values: dict[str, Any], verdict: Verdict, said: str
) -> None:
    with local_zone(rule):
        (found,) = hours_findings(settings(**values), at("2026-07-01 12:00"))
    assert (found.check, found.verdict) == ("uploads.hours", verdict)
    assert found.what == f"{said}; uploads are allowed at {NIGHT}"
    assert ("uploads.time_zone" in found.remedy) is (verdict is Verdict.NOTE)


def test_the_doctor_has_nothing_to_say_without_hours() -> None:
    assert list(hours_findings(UploadSettings(), at("2026-07-01 12:00"))) == []


@pytest.mark.parametrize(
    ("values", "zone", "is_doubted"),
    [("", "(UTC)", True), (", time_zone: Asia/Tokyo", "(Asia/Tokyo)", False)],
)
def test_check_says_by_which_clock(tmp_path: Path, values: str, zone: str, is_doubted: bool) -> None:
    file = tmp_path / "bridge.yaml"
    file.write_text(f'uploads: {{hours: ["{NIGHT}"]{values}}}\n', encoding="utf-8")
    checked = CliRunner().invoke(app, ["check", "--config", str(file)])
    assert (checked.exit_code, checked.stdout) == (0, f"{file}: ok\n")
    assert zone in checked.stderr
    assert ("Set uploads.time_zone" in checked.stderr) is is_doubted


class Hub:
    """A hub at which no receiver runs."""

    async def request(self, _subject: str, _payload: bytes, _timeout_s: float, /) -> bytes:
        raise HubError(HubReason.NO_RESPONDERS, "no receiver")

    def request_many(self, _subject: str, _payload: bytes, _silence_s: float, /) -> AsyncIterator[bytes]:
        raise HubError(HubReason.NO_RESPONDERS, "no receiver")


class Clock:
    """The middle of the night by UTC, whatever the time is."""

    def now(self, zone: tzinfo) -> datetime:
        return at("2026-07-02 01:30").astimezone(zone)


@pytest.mark.parametrize(("zone", "paused"), [("Asia/Tokyo", "it is 10:30 (Asia/Tokyo)"), ("UTC", "")])
async def test_nothing_is_sent_in_the_middle_of_the_robots_day(
    monkeypatch: pytest.MonkeyPatch, zone: str, paused: str
) -> None:
    """The defect: in a container, whose zone is UTC, the hours were those of UTC."""
    monkeypatch.setattr(uploads, "datetime", Clock())
    robot = Robot()
    robot.add("one", {"data.bin": b"one"})
    async with running_uploads(robot, Hub(), "127.0.0.1:9", (), hours=(NIGHT,), time_zone=zone) as running:
        await running.uploads.enqueue("one")
        state = State.PAUSED if paused else State.FAILED
        found = await running.until("one", lambda each: each and each.state is state)
        assert found
        assert found.reason.startswith(paused)
