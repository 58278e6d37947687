"""What typed keys do to the robot, with and without reports of their release."""

import re
from collections import deque

import pytest

from console.cli.drive_keys import (
    ACTIONS,
    ASK_AGAIN_S,
    ASK_ATTRIBUTES,
    ASK_EVERY_S,
    ASK_FLAGS,
    ASK_STATUS,
    ESCAPE_WITHIN_S,
    KNOWN_FOR_S,
    MOST_AT_ONCE,
    MOST_REQUESTS,
    TAP_S,
    Action,
    Hands,
    Liveness,
    Sign,
    flags_in,
    has_status,
    is_complete,
    report_releases,
)
from console.steering import LETTERS, Steering

W_DOWN, W_REPEATED, W_UP = "\x1b[119;1:1u", "\x1b[119;1:2u", "\x1b[119;1:3u"
ANSWER = "\x1b[?15u"
ATTRIBUTES = "\x1b[?62;22c"
ANSWERS = {ASK_FLAGS: ANSWER, ASK_ATTRIBUTES: ATTRIBUTES, ASK_STATUS: "\x1b[0n"}
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
    ("answer", "complete", "flags"),
    [
        ("", False, None),
        ("\x1b[?1u", False, 1),
        ("\x1b[?62;c", True, None),
        ("\x1b[?0u\x1b[?62;4c", True, 0),
        ("\x1b[?62;22c\x1b[?1u", True, 1),
        ("w\x1b[?0u\x1b[?15u\x1b[?62;c", True, 15),
    ],
)
def test_a_terminal_says_which_flags_are_in_force(answer: str, complete: bool, flags: int | None) -> None:
    assert (is_complete(answer), flags_in(answer)) == (complete, flags)


@pytest.mark.parametrize(
    ("flags", "reports"),
    [(None, False), (0, False), (1, False), (2, False), (8, False), (10, True), (15, True)],
)
def test_releases_are_reported_only_with_their_flags_in_force(flags: int | None, reports: bool) -> None:
    assert report_releases(flags) is reports


@pytest.mark.parametrize(
    ("answer", "known"),
    [("\x1b[?0u\x1b[?62;c", False), ("\x1b[0n\x1b[?62;c", True), ("w\x1b[3n\x1b[?62;c", True)],
)
def test_a_terminal_shows_whether_it_answers_for_its_status(answer: str, known: bool) -> None:
    assert has_status(answer) is known


def answer_to(requests: str) -> str:
    """What a terminal answers."""
    return "".join(ANSWERS[request] for request in re.findall(r"\x1b\[[?5]?[ucn]", requests))


def watched(now_s: float = 0.0) -> Hands:
    """At a terminal that has answered now."""
    return Hands(releases=True, liveness=Liveness(now_s))


def test_a_key_counts_as_long_as_the_terminal_answers() -> None:
    hands, now_s = watched(), 0.0
    hands.take(W_DOWN, now_s)
    while now_s < 60.0:
        now_s += ASK_EVERY_S
        request = hands.ask(now_s)
        assert request
        assert not hands.ask(now_s), "one request at a time"
        hands.take(answer_to(request), now_s + 0.05)
        assert not hands.ask(now_s + 0.06), "nor sooner than necessary"
        assert hands.steering(now_s + 0.06) == (1, 0, 0)


def test_a_terminal_that_does_not_answer_any_more_releases() -> None:
    hands = watched()
    hands.take(W_DOWN, 0.0)
    assert hands.ask(0.1)
    assert hands.steering(KNOWN_FOR_S) == (1, 0, 0)
    assert hands.steering(KNOWN_FOR_S + 0.001) is None
    hands.take(W_REPEATED + ANSWER, KNOWN_FOR_S + 0.002)
    assert hands.ask(KNOWN_FOR_S + 0.002)
    hands.take(ANSWER + W_REPEATED, KNOWN_FOR_S + 0.003)
    assert hands.answers(KNOWN_FOR_S + 0.003)
    assert hands.steering(KNOWN_FOR_S + 0.003) is None, "it is still down, and counts when it is pressed anew"
    hands.take(W_UP + W_DOWN, 1.0)
    assert hands.steering(1.0) == (1, 0, 0)


def test_an_answer_that_was_held_up_says_nothing_of_now() -> None:
    """After a cut the events arrive late and in bursts: the release of a key may still be on its way."""
    hands = watched()
    assert hands.ask(0.1)
    hands.take(W_DOWN + ANSWER, 5.0)
    assert hands.steering(5.0) is None
    assert hands.ask(5.0)
    hands.take(W_UP + W_DOWN, 5.2)
    assert hands.steering(5.2) is None, "that may be as old"
    hands.take(ANSWER, 5.25)
    assert hands.steering(5.25) is None
    hands.take(W_UP + W_DOWN, 5.3)
    assert hands.steering(5.3) == (1, 0, 0)


def test_an_answer_that_was_not_requested_says_nothing() -> None:
    hands = watched()
    hands.take(W_DOWN + ANSWER, 0.4)
    assert hands.steering(KNOWN_FOR_S + 0.001) is None


def test_a_terminal_whose_flags_are_taken_away_releases() -> None:
    hands = watched()
    hands.take(W_DOWN, 0.0)
    assert hands.ask(0.1)
    hands.take("\x1b[?0u", 0.1)
    assert hands.steering(0.1) is None


def test_a_key_without_its_protocol_needs_an_answer_as_well() -> None:
    hands = watched()
    hands.take("w", KNOWN_FOR_S)
    assert hands.steering(KNOWN_FOR_S) == Steering(1, 0, 0)
    hands.take("w", 10.0)
    assert hands.steering(10.1) is None


def watched_taps() -> Hands:
    """At a terminal that does not report releases, and has answered now."""
    return Hands(releases=False, liveness=Liveness(0.0, releases=False))


def test_presses_count_as_long_as_the_terminal_answers() -> None:
    hands, now_s = watched_taps(), 0.0
    while now_s < 60.0:
        now_s += ASK_EVERY_S
        request = hands.ask(now_s)
        assert request.startswith(ASK_ATTRIBUTES)
        hands.take("w" + answer_to(request), now_s + 0.05)
        assert not hands.awaits_answer
        assert hands.steering(now_s + 0.06) == (1, 0, 0)


def test_a_press_that_was_held_up_on_its_way_moves_nothing() -> None:
    """After a cut the presses of all that time arrive at once."""
    hands = watched_taps()
    assert hands.ask(0.1)
    hands.take("www" + ATTRIBUTES + "w", 5.0)
    assert not hands.answers(5.0)
    assert hands.steering(5.0) is None
    assert hands.ask(5.0)
    hands.take(ATTRIBUTES, 5.1)
    assert hands.steering(5.1) is None
    hands.take("w", 5.2)
    assert hands.steering(5.2) == (1, 0, 0)


@pytest.mark.parametrize(
    ("releases", "press", "answer"), [(True, W_DOWN, ANSWER), (False, "w", ATTRIBUTES)], ids=["down", "tap"]
)
def test_a_press_that_comes_before_the_next_answer_moves_nothing_in_one_read_with_it(
    releases: bool, press: str, answer: str
) -> None:
    hands = Hands(releases=releases, liveness=Liveness(0.0, releases=releases))
    assert hands.ask(0.1)
    hands.take(answer + press * 90, 5.0)
    assert hands.steering(5.0) is None
    assert hands.ask(5.02)
    hands.take(press * 30 + answer, 5.08)
    assert hands.answers(5.08)
    assert hands.steering(5.08) is None
    hands.take(press, 5.1)
    assert hands.steering(5.1) == (1, 0, 0)


@pytest.mark.parametrize("releases", [True, False])
def test_a_reset_that_was_held_up_resets_no_stop_that_is_newer(releases: bool) -> None:
    """It would be of the stop that is shown now. A stop counts at any age."""
    hands = Hands(releases=releases, liveness=Liveness(0.0, releases=releases))
    assert hands.take("r", 0.2) == [Action.RESET]
    assert hands.take("r x", 5.0) == [Action.STOP, Action.QUIT]


def test_a_terminal_that_is_cut_off_says_so_though_its_presses_count_for_a_moment_alone() -> None:
    hands = watched_taps()
    assert hands.ask(0.1)
    assert hands.answers(KNOWN_FOR_S)
    assert not hands.answers(KNOWN_FOR_S + 0.001)


@pytest.mark.parametrize(("releases", "answer"), [(True, ATTRIBUTES), (False, ANSWER)])
def test_an_answer_to_something_else_is_none(releases: bool, answer: str) -> None:
    hands = Hands(releases=releases, liveness=Liveness(0.0, releases=releases))
    assert hands.ask(0.4)
    hands.take(answer, 0.4)
    assert hands.awaits_answer
    assert not hands.answers(KNOWN_FOR_S + 0.001)


class Line:
    """Hands at the end of a line whose round trip takes a while, and that loses answers at will."""

    def __init__(self, *, releases: bool, round_trip_s: float) -> None:
        self.hands = Hands(releases=releases, liveness=Liveness(0.0, releases=releases))
        self.now_s = 0.0
        self.loses = False
        self._round_trip_s = round_trip_s
        self._on_their_way: deque[tuple[float, str]] = deque()

    def tick(self) -> str:
        """Lets 20 ms pass; returns what is requested in them."""
        self.now_s += 0.02
        if request := self.hands.ask(self.now_s):
            self._on_their_way.append((self.now_s + self._round_trip_s, answer_to(request)))
        while self._on_their_way and self._on_their_way[0][0] <= self.now_s:
            _, answer = self._on_their_way.popleft()
            if not self.loses:
                self.hands.take(answer, self.now_s)
        return request


@pytest.mark.parametrize("lost", range(1, MOST_REQUESTS))
@pytest.mark.parametrize("sooner", range(13))
@pytest.mark.parametrize("releases", [True, False])
def test_lost_answers_cost_nothing_in_the_long_run(releases: bool, sooner: int, lost: int) -> None:
    """The defect: each cost a round trip for ever, and four silenced the keys."""
    line = Line(releases=releases, round_trip_s=0.05)

    def ask(times: int) -> None:
        for _ in range(5_000):
            times -= bool(line.tick())
            if not times:
                return
        raise AssertionError(f"{times} requests are missing")

    if sooner:
        ask(sooner)
    while line.hands.awaits_answer:
        line.tick()
    line.loses = True
    ask(lost)
    for _ in range(3):
        line.tick()
    line.loses = False
    ask(30)
    for _ in range(3):
        line.tick()
    assert not line.hands.awaits_answer, "what was lost is known to be lost"
    assert line.hands.answers(line.now_s)


@pytest.mark.parametrize("answered", [(0, 3, 6), (1, 2, 7), (2, 5, 8), (3, 4), (6,), (8,)])
@pytest.mark.parametrize("releases", [True, False])
def test_an_answer_counts_for_no_request_that_is_newer_than_its_own(
    releases: bool, answered: tuple[int, ...]
) -> None:
    """Whichever of the others are lost."""
    hands = Hands(releases=releases, liveness=Liveness(0.0, releases=releases))
    requests = [(float(at_s), request) for at_s in range(1, 100) if (request := hands.ask(float(at_s)))]
    assert len(requests) == MOST_REQUESTS
    for number in answered:
        asked_s, request = requests[number]
        hands.take(answer_to(request), 100.0)
        assert not hands.answers(asked_s + KNOWN_FOR_S + 0.001)


@pytest.mark.parametrize("round_trip_s", [0.05, 0.3])
@pytest.mark.parametrize("releases", [True, False])
def test_a_key_that_is_down_counts_all_the_time_on_a_long_line(releases: bool, round_trip_s: float) -> None:
    """The defect: beyond 0.25 s the next request waited for the answer, and the robot stopped in between."""
    line = Line(releases=releases, round_trip_s=round_trip_s)
    for _ in range(1_000):
        line.tick()
        assert line.hands.answers(line.now_s)


@pytest.mark.parametrize("round_trip_s", [0.5, 1.9, 30.0])
def test_only_a_few_requests_are_on_their_way_at_once(round_trip_s: float) -> None:
    line = Line(releases=True, round_trip_s=round_trip_s)
    asked_s = []
    for _ in range(5_000):
        if line.tick():
            asked_s.append(line.now_s)
            assert (
                sum(line.now_s - each_s < min(round_trip_s, ASK_AGAIN_S) for each_s in asked_s)
                <= MOST_AT_ONCE
            )


def test_requests_that_are_not_answered_end() -> None:
    liveness = Liveness(0.0)
    requests = [number for number in range(1000) if liveness.ask(float(number))]
    assert len(requests) < 10
    for _ in requests:
        liveness.take(Sign.FLAGS, 15)
    assert liveness.lasts(requests[-1])
    assert liveness.ask(1000.0)


def test_a_mark_gives_no_flags_back_that_were_taken_away() -> None:
    hands, now_s, request = watched(), 0.0, ""
    while ASK_ATTRIBUTES not in request:
        now_s += ASK_EVERY_S
        request = hands.ask(now_s)
        hands.take("\x1b[?0u" + (ATTRIBUTES if ASK_ATTRIBUTES in request else ""), now_s)
        assert not hands.answers(now_s)
    assert not hands.awaits_answer


def test_what_is_typed_before_the_terminal_has_answered_moves_nothing_and_is_no_part_of_it() -> None:
    hands = Hands(releases=False, begun=False)
    assert hands.awaits_answer
    assert hands.take(f"w {W_DOWN}\x1b", 0.0) == [Action.STOP]
    assert hands.take("[?62;c\x1b[32;1", 0.02) == []
    hands.begin(releases=True, liveness=Liveness(0.0))
    assert hands.steering(0.03) is None
    assert hands.take(":1u", 0.04) == [Action.STOP]
    assert not hands.awaits_answer


def test_an_answer_may_come_in_pieces_wherever_it_is_cut() -> None:
    for at in range(1, len(ATTRIBUTES)):
        hands = watched_taps()
        assert hands.ask(0.4)
        assert hands.take(ATTRIBUTES[:at], 0.4) == []
        assert hands.take("", 0.4 + ESCAPE_WITHIN_S / 2) == []
        assert hands.take(ATTRIBUTES[at:], 0.5) == []
        assert hands.answers(0.8)


def test_esc_ends_also_while_an_answer_is_awaited() -> None:
    for then, later_s in (("", ESCAPE_WITHIN_S + 0.01), ("w", 0.01), ("\x1b", 0.01)):
        hands = watched_taps()
        assert hands.ask(0.1)
        assert hands.take("\x1b", 0.2) == []
        assert hands.take(then, 0.2 + later_s) == [Action.QUIT]
