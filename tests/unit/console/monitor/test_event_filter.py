"""Which events are listed, and how they are exported."""

import json

import pytest

from console.monitor.event_filter import AtLeast, EventFilter, as_json_lines
from console.monitor.event_log import EventLine
from console.presentation.severity_style import SeverityStyle

INFO = EventLine(0.0, "preview running, BALANCED")
WARNING = EventLine(1.0, "warning: disk: nearly full", SeverityStyle.WARNING)
ERROR = EventLine(2.0, "error: lidar: stopped Turning", SeverityStyle.BAD, own=True)
JOINED = EventLine(3.0, "anna joined", presence=True)
ALL = (INFO, WARNING, ERROR, JOINED)


@pytest.mark.parametrize(
    ("chosen", "listed"),
    [
        (EventFilter(), (INFO, WARNING, ERROR)),
        (EventFilter(presence=True), ALL),
        (EventFilter(AtLeast.WARNINGS, presence=True), (WARNING, ERROR)),
        (EventFilter(AtLeast.WARNINGS), (WARNING, ERROR)),
        (EventFilter(AtLeast.ERRORS), (ERROR,)),
        (EventFilter(words="  turning LIDAR "), (ERROR,)),
        (EventFilter(AtLeast.WARNINGS, "preview"), ()),
    ],
)
def test_severity_and_all_words_in_any_case(chosen: EventFilter, listed: tuple[EventLine, ...]) -> None:
    assert tuple(line for line in ALL if chosen.lists(line)) == listed


def test_the_export_is_one_json_document_a_line() -> None:
    first, _, third, _ = (json.loads(line) for line in as_json_lines(ALL).splitlines())
    assert first["severity"] == "info"
    assert first["text"] == INFO.text
    assert (third["severity"], third["by"]) == ("error", "monitor")


def test_a_time_that_no_calendar_has_does_not_end_the_export() -> None:
    assert json.loads(as_json_lines([EventLine(1e19, "far\nout")])) == {
        "at": "-",
        "severity": "info",
        "by": "robot",
        "text": "far\nout",
    }
