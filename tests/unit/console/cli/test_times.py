"""Tables of robotctl: every time has its zone, and a component is said once."""

import time
from collections.abc import Iterator
from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console, RenderableType

from console.cli import events, recording_tables
from console.cli.fleet_tables import item_line, recordings_table
from console.client.results import Event, Recording
from console.fleet.values import RobotEvent, StoredRecording
from tests.support.filled_values import filled_value

ZONE = "JST"
AT_MS = 1_795_302_000_000
RECORDING = replace(filled_value(Recording), started_unix_ms=AT_MS, ended_unix_ms=AT_MS)
EVENT = replace(
    filled_value(Event),
    wall_clock_unix_ms=AT_MS,
    component="drive: motor controller",
    message="drive: motor controller: failed",
)


@pytest.fixture(autouse=True)
def in_japan(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with monkeypatch.context() as changed:
        changed.setenv("TZ", f"{ZONE}-9")
        time.tzset()
        yield
    time.tzset()


def printed(shown: RenderableType) -> str:
    out = StringIO()
    Console(file=out, width=400).print(shown)
    return out.getvalue()


def test_times_of_recordings_have_their_zone() -> None:
    assert f"2026-11-22 08:00:00 {ZONE}" in printed(recording_tables.recordings_table((RECORDING,)))
    lines = printed(recording_tables.recording_view(RECORDING)).splitlines()
    times = [line for line in lines if line.split()[:1] in (["began"], ["ended"], ["gap"])]
    assert len(times) == 3
    assert all(ZONE in line for line in times)


def test_times_of_a_fleet_have_their_zone() -> None:
    event = item_line(RobotEvent(robot="lab", received_unix_ms=AT_MS, event=EVENT))
    assert event.plain.startswith(f"2026-11-22 08:00:00 {ZONE}")
    stored = replace(filled_value(StoredRecording), recording=RECORDING)
    assert f"2026-11-22 08:00:00 {ZONE}" in printed(recordings_table([stored]))


def test_an_event_says_its_component_once() -> None:
    own = "  ".join(text.plain for text in events._columns(EVENT))
    of_fleet = item_line(RobotEvent(robot="lab", received_unix_ms=AT_MS, event=EVENT)).plain
    for line in (own, of_fleet):
        assert line.count("drive: motor controller") == 1
        assert line.endswith("failed")
