"""The keys of robotctl drive: what is typed becomes hands on the controls. Pure.

Most terminals report that a key was pressed, and never that it was released: there each press moves the robot
for a moment (TAP_S), and a key that is held repeats. Terminals with the kitty keyboard protocol
(https://sw.kovidgoyal.net/kitty/keyboard-protocol) report releases: there a key moves the robot as long as it
is down. Either counts only as long as the terminal answers: one that is frozen or cut off reports no release,
and what it reports when it goes on may be as old as that.
"""

import math
import re
from collections import deque
from enum import Enum
from typing import Final

from console.steering import LETTERS, Direction, Steering, steering_of

TAP_S: Final = 0.3
"""How long a press counts where releases are not reported: beyond the usual interval of repeats (30 a
second), and short of the delay before the first."""
ASK_EVERY_S: Final = 0.1
"""Between two requests for a sign of life."""
ASK_AGAIN_S: Final = 2.0
"""From the newest of MOST_AT_ONCE requests without an answer to the next one; twice as long to each
further one."""
MOST_AT_ONCE: Final = 4
"""Requests of the last ASK_AGAIN_S that are not answered. With ASK_EVERY_S between them, enough for round
trips of 0.4 s; after longer ones an answer is too old (KNOWN_FOR_S)."""
MOST_REQUESTS: Final = 9
"""That are not answered at all. A terminal that is silent for a minute is not asked before it answers."""
KNOWN_FOR_S: Final = 0.5
"""How long a key counts after the newest request that the terminal has answered. Beyond ASK_EVERY_S and the
round trips of most networks."""
ESCAPE_WITHIN_S: Final = 0.05
"""From the first character of an answer to its second, which a slow line may deliver by itself. What follows
later, or never, makes the first the key Esc."""

ASK_FLAGS: Final = "\x1b[?u"
"""Requests the protocol's flags that are in force."""
ASK_ATTRIBUTES: Final = "\x1b[c"
"""Requests what every terminal answers (DA1)."""
ASK_STATUS: Final = "\x1b[5n"
"""Requests what nearly every terminal answers (DSR)."""
ASK_ALL: Final = ASK_FLAGS + ASK_STATUS + ASK_ATTRIBUTES
"""The last, so that silence is an answer to the others."""
RELEASES_BEGIN: Final = "\x1b[>15u"
"""Escape codes for all keys, with their releases and their places on the keyboard (1 + 2 + 4 + 8)."""
RELEASES_END: Final = "\x1b[<u"
FOCUS_BEGIN: Final = "\x1b[?1004h"
"""Reports of the focus (xterm)."""
FOCUS_END: Final = "\x1b[?1004l"

_SEQUENCE: Final = re.compile(
    r"\x1b\[(?P<parameters>[0-9:;?]{0,64})(?P<final>[@-~])|\x1bO(?P<application>[A-Z])|(?P<character>.)",
    re.DOTALL,
)
_ESCAPE: Final = "\x1b"
_UNFINISHED: Final = re.compile(r"\x1b(?:\[[0-9:;?]{0,64}|O)?$")
_FLAGS: Final = re.compile(r"\x1b\[\?([0-9]+)u")
_ATTRIBUTES: Final = re.compile(r"\x1b\[\?[0-9;]*c")
_STATUSES: Final = ("0", "3")
"""Parameters of the answer to ASK_STATUS: ready, and not."""
_STATUS: Final = re.compile(rf"\x1b\[[{''.join(_STATUSES)}]n")
_NEEDED: Final = 2 | 8
"""Flags with which the release of a letter is reported."""
_PRESSED: Final = ("", "1")
_RELEASED: Final = "3"
"""The protocol's types of events; 2 is a repeat."""
_CONTROL: Final = 4
_COMMANDING: Final = 2 | _CONTROL | 8 | 16 | 32
"""Alt, Control, Super, Hyper, Meta: with them a key means something else. Bits of the protocol's modifiers,
which are 1 more than their bits."""


class Action(Enum):
    """What is to be done once."""

    STOP = "stop"
    RESET = "reset"
    QUIT = "quit"
    RELEASE = "release"
    """The terminal has lost the focus: whatever steers is released."""


_ARROWS: Final = {
    "A": Direction.FORWARD,
    "B": Direction.BACK,
    "C": Direction.TURN_RIGHT,
    "D": Direction.TURN_LEFT,
}
ACTIONS: Final = {
    " ": Action.STOP,
    "\x00": Action.STOP,
    "r": Action.RESET,
    "x": Action.QUIT,
    "\x1b": Action.QUIT,
    "\x03": Action.QUIT,
}
"""By what a key types; Control with Space types NUL."""


def is_complete(answer: str) -> bool:
    """Returns whether the terminal has answered all of ASK_ALL."""
    return _ATTRIBUTES.search(answer) is not None


def flags_in(answer: str) -> int | None:
    """Returns the newest flags in an answer; None where the terminal does not speak the protocol."""
    found = _FLAGS.findall(answer)
    return int(found[-1]) if found else None


def has_status(answer: str) -> bool:
    """Returns whether the terminal has answered ASK_STATUS."""
    return _STATUS.search(answer) is not None


def report_releases(flags: int | None) -> bool:
    """Returns whether a terminal with these flags in force reports the release of every key."""
    return flags is not None and flags & _NEEDED == _NEEDED


class Sign(Enum):
    """What a terminal is asked for, as the request for it."""

    FLAGS = ASK_FLAGS
    ATTRIBUTES = ASK_ATTRIBUTES
    STATUS = ASK_STATUS


_MARKED: Final = frozenset({3, 4, 6, 12})
_MARKS_REPEAT: Final = 13
"""Which of so many requests have a mark: a planar difference set, which agrees with itself shifted by 1 to 12
requests in one mark alone. Requests at equal distances could be taken for each other as often as answers are
lost."""


class Liveness:
    """Until when the keys are known: a terminal that is frozen or cut off reports no release, and no press.

    It is asked again and again: for its flags if it reports releases, else for its attributes. Its answer
    comes after the keys' events from before: it makes them known as of the moment when the request was sent,
    however late it is.

    Answers come in order and without a number, and some are lost: a shell reads them after Ctrl-Z, for
    example. Each counts for the oldest request that it can be an answer to, so that no key is taken for newer
    than it is, and the answers to older requests count as lost. Some requests have another one, of another
    kind, behind them: a mark, by whose answer it shows which requests were answered before it.

    Args:
        now_s: When the terminal has answered last.
        releases: Whether it reports releases.
        marks: Whether it answers ASK_STATUS; for a terminal that reports releases that does not matter.
            Without it lost answers make all that follow count for older requests.
    """

    def __init__(self, now_s: float, *, releases: bool = True, marks: bool = True) -> None:
        self._sign = Sign.FLAGS if releases else Sign.ATTRIBUTES
        mark = Sign.ATTRIBUTES if releases else Sign.STATUS
        self._mark = mark if releases or marks else None
        self._known_s = now_s
        self._awaited: deque[tuple[Sign, float]] = deque()
        """What was requested when and is not answered yet, the oldest first: MOST_REQUESTS and marks."""
        self._requests = 0
        self._unheard = 0
        """Requests since the newest answer."""
        self._newest_s = -math.inf
        """When the newest request was sent."""

    @property
    def awaited(self) -> bool:
        """Whether an answer is due."""
        return bool(self._awaited)

    def ask(self, now_s: float) -> str:
        """Returns the request that is to be sent now; empty for none."""
        if not self._may_ask(now_s):
            return ""
        signs = [self._sign]
        if self._mark and self._requests % _MARKS_REPEAT in _MARKED:
            signs.append(self._mark)
        self._awaited.extend((sign, now_s) for sign in signs)
        self._requests += 1
        self._unheard += 1
        self._newest_s = now_s
        return "".join(sign.value for sign in signs)

    def take(self, sign: Sign, flags: int | None = None) -> None:
        """Takes an answer. Without the flags for releases nothing is known.

        Args:
            sign: What it answers.
            flags: In an answer to Sign.FLAGS.
        """
        if all(sign is not awaited for awaited, _ in self._awaited):
            return
        awaited, asked_s = self._awaited.popleft()
        while awaited is not sign:
            awaited, asked_s = self._awaited.popleft()
        self._unheard = 0
        if sign is self._sign:
            self._known_s = asked_s if flags is None or report_releases(flags) else -math.inf

    def _may_ask(self, now_s: float) -> bool:
        unanswered_s = [asked_s for sign, asked_s in self._awaited if sign is self._sign]
        if len(unanswered_s) >= MOST_REQUESTS:
            return False
        if sum(now_s - asked_s < ASK_AGAIN_S for asked_s in unanswered_s) >= MOST_AT_ONCE:
            return False
        silent = self._unheard - MOST_AT_ONCE
        pause_s = ASK_EVERY_S if silent < 0 else ASK_AGAIN_S * 2**silent
        return now_s >= self._newest_s + pause_s

    def lasts(self, now_s: float) -> bool:
        """Returns whether the terminal has answered in time."""
        return now_s - self._known_s <= KNOWN_FOR_S


class Hands:
    """Which keys are down.

    Args:
        releases: Whether the terminal reports releases.
        liveness: Of the terminal, and is given its answers; None for one that never answers.
        begun: Whether that is known; else `begin` follows.
    """

    def __init__(self, *, releases: bool, liveness: Liveness | None = None, begun: bool = True) -> None:
        self.releases = releases
        self._liveness = liveness
        self._begun = begun
        self._down: dict[str, Direction] = {}
        """By the place on the keyboard: what a key means may change before it is released."""
        self._taps: dict[Direction, float] = {}
        """When each was pressed last whose release is not reported."""
        self._unfinished = ""
        self._typed_s = -math.inf

    def begin(self, *, releases: bool, liveness: Liveness | None) -> None:
        """Takes what the terminal reports, as the arguments of the class; releases all keys."""
        self.releases, self._liveness, self._begun = releases, liveness, True
        self.release()

    def take(self, typed: str, now_s: float) -> list[Action]:
        """Takes what was typed; returns what is to be done once, in order.

        To be called again and again, also where nothing was typed: after a moment without more, the first
        character of an answer is the key Esc.
        """
        if typed:
            self._typed_s = now_s
        typed = self._unfinished + typed
        unfinished = _UNFINISHED.search(typed)
        self._unfinished = unfinished[0] if unfinished else ""
        may_begin_answer = self.awaits_answer and now_s - self._typed_s < ESCAPE_WITHIN_S
        if self._unfinished == _ESCAPE and not may_begin_answer:
            self._unfinished = ""
        actions = []
        for found in _SEQUENCE.finditer(typed[: len(typed) - len(self._unfinished)]):
            action = self._take(found, now_s)
            # A reset that was held up would be of the stop that is shown now, which may be another one.
            if action and (action is not Action.RESET or self.answers(now_s)):
                actions.append(action)
        return actions

    def release(self) -> None:
        """Releases all keys. What is still down counts only when it is pressed anew."""
        self._down.clear()
        self._taps.clear()

    def steering(self, now_s: float) -> Steering | None:
        """Returns what the keys that are down amount to; None with no key down."""
        if not self.answers(now_s):
            self.release()
        self._taps = {key: at_s for key, at_s in self._taps.items() if now_s - at_s < TAP_S}
        return steering_of({*self._down.values(), *self._taps})

    @property
    def ages_known(self) -> bool:
        """Whether it is known how old a press is; else it counts at any age."""
        return self._liveness is not None

    @property
    def awaits_answer(self) -> bool:
        """Whether the terminal has yet to give a sign of life that was requested."""
        return not self._begun or (self._liveness is not None and self._liveness.awaited)

    def ask(self, now_s: float) -> str:
        """Returns the request for a sign of life that is to be sent now; empty for none."""
        return self._liveness.ask(now_s) if self._liveness else ""

    def answers(self, now_s: float) -> bool:
        """Returns whether the terminal answers, so that its keys count."""
        return self._liveness is None or self._liveness.lasts(now_s)

    def _take(self, found: "re.Match[str]", now_s: float) -> Action | None:
        if found["character"]:
            return self._character(found["character"].lower(), now_s)
        if found["application"]:
            self._tap(_ARROWS.get(found["application"]), now_s)
            return None
        return self._sequence(found["parameters"], found["final"], now_s)

    def _character(self, character: str, now_s: float) -> Action | None:
        """Takes a key without its protocol: no release will follow."""
        self._tap(LETTERS.get(character), now_s)
        return ACTIONS.get(character)

    def _sequence(self, parameters: str, final: str, now_s: float) -> Action | None:
        if parameters.startswith("?"):
            self._answer(parameters[1:], final)
            return None
        if final == "n" and parameters in _STATUSES:
            self._heard(Sign.STATUS)
            return None
        if final == "O" and not parameters:
            self.release()  # Releases go elsewhere now.
            return Action.RELEASE
        key, _, rest = parameters.partition(";")
        number, event = rest.partition(";")[0].partition(":")[::2]
        modifiers = int(number) - 1 if number.isdigit() else 0
        if final in _ARROWS:
            self._steer(final, _ARROWS[final], event, modifiers, now_s)
            return None
        if final != "u":
            return None
        code, _, alternates = key.partition(":")
        character = _character_of(code)
        place = _character_of(alternates.partition(":")[2]) or character
        self._steer(place, LETTERS.get(character), event, modifiers, now_s)
        return _action(character, event, modifiers)

    def _answer(self, parameters: str, final: str) -> None:
        if final == "c":
            self._heard(Sign.ATTRIBUTES)
        elif final == "u" and parameters.isdigit():
            self._heard(Sign.FLAGS, int(parameters))

    def _heard(self, sign: Sign, flags: int | None = None) -> None:
        if self._liveness:
            self._liveness.take(sign, flags)

    def _steer(
        self, place: str, direction: Direction | None, event: str, modifiers: int, now_s: float
    ) -> None:
        """Takes an event of a key; a repeat begins nothing."""
        if event == _RELEASED:
            self._down.pop(place, None)
            if direction:
                self._taps.pop(direction, None)
        elif direction is None or modifiers & _COMMANDING:
            return
        elif not self.releases:
            self._tap(direction, now_s)
        elif event in _PRESSED and self.answers(now_s):
            self._down[place] = direction

    def _tap(self, direction: Direction | None, now_s: float) -> None:
        # Held up on its way, it is not known for how long: also where the next answer is in the same read.
        if direction and self.answers(now_s):
            self._taps[direction] = now_s


def _character_of(code: str) -> str:
    """Returns a key's character, the same with Shift and without; empty for what is none."""
    return chr(int(code)).lower() if code.isdigit() and 0 < int(code) < 0x110000 else ""


def _action(character: str, event: str, modifiers: int) -> Action | None:
    action = ACTIONS.get(character)
    if modifiers & _CONTROL and character == "c":
        return Action.QUIT
    if event not in _PRESSED or (modifiers & _COMMANDING and action is not Action.STOP):
        return None
    return action
