"""The connection in words."""

import pytest

from console.client import DeadlineExceeded, GatewayError, NotAllowed, Unreachable
from console.monitor.link import Link, Phase, link_words
from console.tone import Tone

TARGET = "lab-1:50051"


def lost(trouble: GatewayError, next_try_s: float | None) -> Link:
    return Link(phase=Phase.LOST, since_s=100, trouble=trouble, attempts=3, next_try_s=next_try_s)


def test_connected() -> None:
    words = link_words(Link(phase=Phase.CONNECTED, since_s=0, answer_ms=3.4), TARGET, 100)
    assert (words.mark, words.tone, words.detail) == ("connected", Tone.GOOD, "answers in 3 ms")
    assert not words.banner


def test_connecting_is_no_alarm() -> None:
    words = link_words(Link(phase=Phase.CONNECTING, since_s=98.5), TARGET, 100)
    assert (words.mark, words.tone, words.detail, words.banner) == (
        "connecting",
        Tone.QUIET,
        "for 1.5 s",
        "",
    )


def test_unreachable_says_what_happened_what_to_do_and_what_comes_next() -> None:
    words = link_words(lost(Unreachable("nothing listens there", "Start it"), 113.2), TARGET, 112)
    assert (words.mark, words.tone, words.detail) == ("unreachable", Tone.BAD, "for 12.0 s")
    assert words.banner == "Nothing listens there. Start it"
    assert words.retry == "No answer for 12.0 s. Attempt 4 in 2 s."


def test_an_attempt_under_way_says_so() -> None:
    words = link_words(lost(Unreachable("gone"), None), TARGET, 112)
    assert words.retry.endswith("Attempt 4 is under way.")


@pytest.mark.parametrize(
    ("trouble", "mark"),
    [
        (DeadlineExceeded("silence"), "unreachable"),
        (NotAllowed("who are you"), "not allowed"),
    ],
)
def test_a_robot_that_refuses_is_not_called_unreachable(trouble: GatewayError, mark: str) -> None:
    assert link_words(lost(trouble, 113), TARGET, 112).mark == mark


def test_who_is_refused_learns_what_would_help_and_that_nobody_was_silent() -> None:
    words = link_words(lost(NotAllowed("the token of anna was revoked"), 117), TARGET, 112)
    assert words.banner.startswith("The token of anna was revoked. Ask this robot's administrator")
    assert words.retry == "No access for 12.0 s. Attempt 4 in 5 s, or as soon as another login is stored."
