"""What typed keys do to the robot, with and without reports of their release."""

import pytest

from console.cli.drive_keys import ACTIONS, TAP_S, Action, Hands, reports_releases
from console.steering import LETTERS

W_DOWN, W_REPEATED, W_UP = "\x1b[119;1:1u", "\x1b[119;1:2u", "\x1b[119;1:3u"
CONTROL = 5
MODIFIERS = (2, 3, CONTROL, 9, 17, 33, 65, 129, 255)
"""Shift, Alt, Control, Super, Hyper, Meta, the two locks, nearly all: in the protocol's form."""


def test_without_releases_a_press_counts_for_a_moment() -> None:
    hands = Hands(releases=False)
    assert hands.steering(0.0) is None
    assert hands.take("w", 0.0) == []
    assert hands.steering(TAP_S - 0.01) == (1, 0, 0)
    assert hands.steering(TAP_S) is None


def test_a_repeated_key_goes_on() -> None:
    hands = Hands(releases=False)
    for number in range(40):
        hands.take("a", number / 30)
        assert hands.steering(number / 30 + 0.03) == (0, 0, 1)


@pytest.mark.parametrize(
    ("typed", "velocity"),
    [
        ("w", (1, 0, 0)),
        ("S", (-1, 0, 0)),
        ("q", (0, 1, 0)),
        ("e", (0, -1, 0)),
        ("d", (0, 0, -1)),
        ("\x1b[A", (1, 0, 0)),
        ("\x1b[B", (-1, 0, 0)),
        ("\x1b[D", (0, 0, 1)),
        ("\x1bOC", (0, 0, -1)),
        ("wd", (1, 0, -1)),
        ("ws", (0, 0, 0)),
    ],
)
def test_each_key_has_its_direction(typed: str, velocity: tuple[int, int, int]) -> None:
    hands = Hands(releases=False)
    hands.take(typed, 0.0)
    assert hands.steering(0.0) == velocity


def test_with_releases_a_key_counts_while_it_is_down() -> None:
    hands = Hands(releases=True)
    hands.take("\x1b[119;1:1u", 0.0)
    assert hands.steering(60.0) == (1, 0, 0)
    hands.take("\x1b[119;1:2u\x1b[1;1:1D", 61.0)
    assert hands.steering(61.0) == (1, 0, 1)
    hands.take("\x1b[119;1:3u", 62.0)
    assert hands.steering(62.0) == (0, 0, 1)
    hands.take("\x1b[1;1:3D", 63.0)
    assert hands.steering(63.0) is None


def test_a_terminal_that_loses_the_focus_releases_everything() -> None:
    hands = Hands(releases=True)
    hands.take("\x1b[119u", 0.0)
    hands.take("\x1b[O", 1.0)
    assert hands.steering(1.0) is None
    hands.take("\x1b[I", 2.0)
    assert hands.steering(2.0) is None


@pytest.mark.parametrize(
    ("typed", "actions"),
    [
        (" ", [Action.STOP]),
        ("\x1b[32;1:1u", [Action.STOP]),
        ("\x1b[32;1:2u", []),
        ("\x1b[32;1:3u", []),
        ("r", [Action.RESET]),
        ("x", [Action.QUIT]),
        ("\x1b", [Action.QUIT]),
        ("\x1b[27u", [Action.QUIT]),
        ("\x1b[99;5u", [Action.QUIT]),
        ("\x1b[99;5:3u", [Action.QUIT]),
        ("\x03", [Action.QUIT]),
        ("w r", [Action.STOP, Action.RESET]),
        ("z\x1b[15~\x1b[57441;2:1u\x1b[u", []),
    ],
)
def test_actions_come_once_for_each_press(typed: str, actions: list[Action]) -> None:
    assert Hands(releases=True).take(typed, 0.0) == actions


def test_a_sequence_may_arrive_in_pieces() -> None:
    hands = Hands(releases=True)
    for piece in ("\x1b[11", "9;1", ":1", "u"):
        assert hands.take(piece, 0.0) == []
    assert hands.steering(0.0) == (1, 0, 0)


def test_no_key_has_two_meanings() -> None:
    assert not LETTERS.keys() & ACTIONS.keys()


@pytest.mark.parametrize("modifiers", MODIFIERS)
@pytest.mark.parametrize(
    ("press", "release"), [(W_DOWN, "\x1b[119;{}:3u"), ("\x1b[A", "\x1b[1;{}:3A")], ids=["letter", "arrow"]
)
def test_a_release_counts_whatever_else_is_down(press: str, release: str, modifiers: int) -> None:
    hands = Hands(releases=True)
    hands.take(press, 0.0)
    assert hands.steering(0.0) == (1, 0, 0)
    hands.take(release.format(modifiers), 1.0)
    assert hands.steering(1.0) is None


@pytest.mark.parametrize("modifiers", [3, CONTROL, 9, 17, 33])
def test_a_press_that_means_something_else_steers_nothing(modifiers: int) -> None:
    hands = Hands(releases=True)
    assert hands.take(f"\x1b[119;{modifiers}:1u\x1b[1;{modifiers}:1A\x1b[114;{modifiers}:1u", 0.0) == []
    assert hands.steering(0.0) is None


def test_control_with_a_key_that_is_down_keeps_it_down_no_longer() -> None:
    hands = Hands(releases=True)
    hands.take(f"{W_DOWN}\x1b[57442;{CONTROL}:1u\x1b[119;{CONTROL}:3u\x1b[57442;1:3u", 0.0)
    assert hands.steering(0.0) is None


@pytest.mark.parametrize("modifiers", MODIFIERS)
def test_space_stops_whatever_else_is_down(modifiers: int) -> None:
    hands = Hands(releases=True)
    assert hands.take(f"\x1b[32;{modifiers}:1u", 0.0) == [Action.STOP]
    assert hands.take(f"\x1b[32;{modifiers}:2u\x1b[32;{modifiers}:3u", 0.0) == []


@pytest.mark.parametrize("typed", ["\x00", "\x1b "], ids=["control", "alt"])
def test_space_stops_with_a_modifier_where_releases_are_not_reported(typed: str) -> None:
    assert Action.STOP in Hands(releases=False).take(typed, 0.0)


def test_text_without_a_key_is_no_key() -> None:
    assert Hands(releases=True).take("\x1b[0;;32u\x1b[1114112u\x1b[99999999u", 0.0) == []


def test_a_key_whose_meaning_has_changed_is_released_by_its_place() -> None:
    hands = Hands(releases=True)
    hands.take(W_DOWN, 0.0)
    hands.take("\x1b[1094::119;1:3u", 1.0)
    assert hands.steering(1.0) is None, "a Cyrillic layout"
    hands.take("\x1b[119:87;2:1u", 2.0)
    assert hands.steering(2.0) == (1, 0, 0), "with Shift"
    hands.take(W_UP, 3.0)
    assert hands.steering(3.0) is None
    hands.take("\x1b[87;2:1u", 4.0)
    hands.take(W_UP, 5.0)
    assert hands.steering(5.0) is None, "a terminal that reports the letter with Shift"


def test_two_keys_of_one_direction_are_one_and_each_has_its_release() -> None:
    hands = Hands(releases=True)
    hands.take(f"{W_DOWN}\x1b[A", 0.0)
    assert hands.steering(0.0) == (1, 0, 0)
    hands.take(W_UP, 1.0)
    assert hands.steering(1.0) == (1, 0, 0)
    hands.take("\x1b[1;1:3A", 2.0)
    assert hands.steering(2.0) is None


@pytest.mark.parametrize("released_by", ["focus", "stop"])
def test_a_repeat_does_not_press_a_released_key_again(released_by: str) -> None:
    hands = Hands(releases=True)
    hands.take(W_DOWN, 0.0)
    if released_by == "focus":
        assert hands.take("\x1b[O", 1.0) == [Action.RELEASE]
    else:
        hands.release()
    hands.take(W_REPEATED, 2.0)
    assert hands.steering(2.0) is None
    hands.take(W_UP + W_DOWN, 3.0)
    assert hands.steering(3.0) == (1, 0, 0)


def test_a_key_without_its_protocol_counts_for_a_moment_even_where_releases_are_reported() -> None:
    for typed in ("w", "\x1bOA"):
        hands = Hands(releases=True)
        hands.take(typed, 0.0)
        assert hands.steering(TAP_S - 0.01) == (1, 0, 0)
        assert hands.steering(TAP_S) is None


@pytest.mark.parametrize(
    ("answer", "reports"),
    [
        ("", None),
        ("\x1b[?1u", None),
        ("\x1b[?62;c", False),
        ("\x1b[?0u\x1b[?62;4c", True),
        ("\x1b[?62;22c\x1b[?1u", True),
    ],
)
def test_a_terminal_says_whether_it_reports_releases(answer: str, reports: bool | None) -> None:
    assert reports_releases(answer) is reports
