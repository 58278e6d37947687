"""Log lines as people and programs read them."""

import json
import logging
from collections.abc import Iterator
from datetime import datetime

import pytest

from common import logs, request_id

_log = logging.getLogger("gateway.somewhere")


@pytest.fixture(autouse=True)
def _as_before() -> Iterator[None]:
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    root.handlers[:] = handlers
    root.setLevel(level)


def test_a_person_reads_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    logs.configure("info")
    _log.info("hello %s", "robot")
    with request_id.continuing("shift-7"):
        _log.warning("asked")
    first, second = capsys.readouterr().err.splitlines()
    assert first.endswith("INFO    gateway.somewhere: hello robot")
    assert second.endswith("WARNING gateway.somewhere: asked [request shift-7]")


@pytest.mark.parametrize("form", ["human", "json"])
def test_what_a_record_quotes_forges_no_line_and_steers_no_terminal(
    capsys: pytest.CaptureFixture[str], form: logs.Format
) -> None:
    logs.configure("info", form)
    _log.info("encoding '%s'", "a\nERROR forged\x1b]52;c;aGk=\x07\u2028\x9b2J\u202e")
    (line,) = capsys.readouterr().err.split("\n")[:-1]
    assert line.isprintable()
    assert "forged" in line


def test_a_program_reads_one_object_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    logs.configure("info", "json")
    _log.info("two\nlines, \u00fcml\u00e4ut and a %d", 7)
    with request_id.continuing("shift-7"):
        _log.info("asked")
    first, second = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    assert datetime.fromisoformat(first.pop("time")).tzinfo is not None
    assert first == {
        "level": "info",
        "logger": "gateway.somewhere",
        "message": "two\nlines, \u00fcml\u00e4ut and a 7",
    }
    assert second["request_id"] == "shift-7"


def test_an_exception_stays_in_its_line(capsys: pytest.CaptureFixture[str]) -> None:
    logs.configure("info", "json")
    try:
        int("no number")
    except ValueError:
        _log.exception("it failed")
    (line,) = capsys.readouterr().err.splitlines()
    parsed = json.loads(line)
    assert parsed["message"] == "it failed"
    assert "Traceback" in parsed["exception"]
    assert "ValueError: invalid literal" in parsed["exception"]


def test_what_is_below_the_level_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    logs.configure("warning", "json")
    _log.info("chatter")
    assert capsys.readouterr().err == ""
