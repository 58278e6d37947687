"""The connection in text."""

import pytest

from console.client import DeadlineExceeded, GatewayError, NotAllowed, Unreachable
from console.monitor.link import Link, LinkState, is_alarming, link_text
from console.presentation.severity_style import SeverityStyle

TARGET = "lab-1:50051"


def lost(error: GatewayError, next_try_s: float | None) -> Link:
    return Link(state=LinkState.LOST, since_s=100, error=error, attempts=3, next_try_s=next_try_s)


def test_connected() -> None:
    text = link_text(Link(state=LinkState.CONNECTED, since_s=0, answer_ms=3.4), TARGET, 100)
    assert (text.mark, text.style, text.detail) == ("connected", SeverityStyle.GOOD, "answers in 3 ms")
    assert not text.banner


def test_connecting_is_no_alarm() -> None:
    text = link_text(Link(state=LinkState.CONNECTING, since_s=98.5), TARGET, 100)
    assert (text.mark, text.style, text.detail, text.banner) == (
        "connecting",
        SeverityStyle.QUIET,
        "for 1.5 s",
        "",
    )


def test_unreachable_says_what_happened_what_to_do_and_what_comes_next() -> None:
    text = link_text(lost(Unreachable("nothing listens there", "Start it"), 113.2), TARGET, 112)
    assert (text.mark, text.style, text.detail) == ("unreachable", SeverityStyle.BAD, "for 12.0 s")
    assert text.banner == "Nothing listens there. Start it"
    assert text.retry == "No answer for 12.0 s. Attempt 4 in 2 s."


def test_an_attempt_under_way_says_so() -> None:
    text = link_text(lost(Unreachable("gone"), None), TARGET, 112)
    assert text.retry.endswith("Attempt 4 is under way.")


@pytest.mark.parametrize(
    ("error", "mark"),
    [
        (DeadlineExceeded("silence"), "unreachable"),
        (NotAllowed("who are you"), "not allowed"),
    ],
)
def test_a_robot_that_refuses_is_not_called_unreachable(error: GatewayError, mark: str) -> None:
    assert link_text(lost(error, 113), TARGET, 112).mark == mark


def test_who_is_refused_learns_what_would_help_and_that_the_robot_was_not_silent() -> None:
    text = link_text(lost(NotAllowed("the token of anna was revoked"), 117), TARGET, 112)
    assert text.banner.startswith("The token of anna was revoked. Ask this robot's administrator")
    assert text.retry == "No access for 12.0 s. Attempt 4 in 5 s, or as soon as another login is stored."


def test_a_loss_alarms_when_it_lasts() -> None:
    link = lost(Unreachable("gone"), None)
    assert [is_alarming(link, 100 + for_s) for for_s in (0, 2.9, 3, 60)] == [False, False, True, True]


@pytest.mark.parametrize("state", [LinkState.CONNECTING, LinkState.CONNECTED])
def test_no_other_state_alarms(state: LinkState) -> None:
    assert not is_alarming(Link(state=state, since_s=0), 1e6)
