"""What every command of robotctl promises, those to come included: they are read from the program."""

import json
import re
from collections.abc import Iterator

import pytest

from console.cli.app import command_line
from console.client import Backoff, ClientOptions
from tests.support.free import free_tcp_port
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.robotctl import only_line, robotctl
from tests.support.robotctl_docs import DOCS

RECORDS = (
    *("start", "stop", "snapshot", "list", "show", "pin", "unpin", "delete", "export"),
    *("upload", "cancel-upload"),
)
GROUPS = {"preview": ("on", "off"), "record": RECORDS, "robots": ("add", "remove", "default")}
# They ask no robot, or show a window, which has no answer to print.
WITHOUT_A_ROBOT = {"robots", "login", "logout", "fleet", "practice"}
WINDOW = {"monitor"}
ONE_ATTEMPT = ClientOptions(backoff=Backoff(give_up_after_s=0))
"""The attempts after the first one take 0.7 s: tests/integration/console/test_client.py has them."""
# Without further words these would not end by themselves.
WORDS = {
    "reset-stop": ("1",),
    "watch": ("--count", "1"),
    "view": ("--headless", "--frames", "1"),
    **{
        f"record {each}": ("ID",)
        for each in ("show", "pin", "unpin", "delete", "export", "upload", "cancel-upload")
    },
}


def names() -> list[str]:
    return sorted(command_line().commands)


def lines() -> Iterator[tuple[str, ...]]:
    """Each command that asks a robot, as it is typed."""
    for name in names():
        if name in WITHOUT_A_ROBOT | WINDOW:
            continue
        for word in GROUPS.get(name, (None,)):
            typed = (name, word) if word else (name,)
            yield (*typed, *WORDS.get(" ".join(typed), ()))


def test_they_are_found() -> None:
    assert {"status", "watch", "preview", "view", "overlay", "events", "doctor", "monitor"} <= set(names())


@pytest.mark.parametrize("words", list(lines()), ids=" ".join)
def test_without_a_robot_it_ends_3_with_one_line(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("console.client.aio.ClientOptions", lambda: ONE_ATTEMPT)
    target = f"127.0.0.1:{free_tcp_port()}"
    ended = robotctl(*words, "--target", target)
    assert ended.returncode == 3, ended.stderr
    as_json = robotctl(*words, "--target", target, "--json")
    assert as_json.returncode == 3
    if words[0] == "doctor":  # what it found is its answer
        assert "nothing listens" in ended.stdout
        assert json.loads(as_json.stdout)["ok"] is False
        return
    assert ended.stdout == as_json.stdout == ""
    assert only_line(ended.stderr).startswith("error: ")
    assert json.loads(only_line(as_json.stderr))["error"]["kind"] == "unreachable"


@pytest.mark.parametrize("words", list(lines()), ids=" ".join)
def test_a_robot_is_chosen_by_address_and_by_name(words: tuple[str, ...]) -> None:
    shown = robotctl(*words[: 2 if words[0] in GROUPS else 1], "--help").stdout
    for option in ("--target", "--robot", "--json"):
        assert option in shown, option


@pytest.mark.parametrize("extra", [{}, {"NO_COLOR": "1"}, {"NO_COLOR": "1", "FORCE_COLOR": "1"}], ids=str)
def test_there_is_no_colour_where_it_is_switched_off(extra: dict[str, str]) -> None:
    with serving(GatewayDouble()) as port:
        for words in (("status",), ("overlay",), ("info",), ("doctor",), ("preview", "on"), ("robots",)):
            shown = robotctl("--target", f"127.0.0.1:{port}", *words, **extra).stdout
            assert shown
            coloured = re.findall(r"\x1b\[[0-9;]*(?:3[0-8]|9[0-7])[0-9;]*m", shown)
            assert not coloured, words
            if "FORCE_COLOR" not in extra:
                assert "\x1b" not in shown


def test_the_page_has_a_row_for_each() -> None:
    page = DOCS.read_text(encoding="utf-8")
    for name in names():
        for word in (f"`{name}`", *(f"`{name} {word}`" for word in GROUPS.get(name, ()) if name != "robots")):
            if name in {"preview", "record"} and word == f"`{name}`":
                continue
            assert f"| {word} |" in page or f"| {word}, " in page or f", {word} |" in page, word
