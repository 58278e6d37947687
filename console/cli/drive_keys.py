"""The keys of robotctl drive: what is typed becomes hands on the controls. Pure.

Most terminals report that a key was pressed, and never that it was released: there each press moves the robot
for a moment (TAP_S), and a key that is held repeats. Terminals with the kitty keyboard protocol
(https://sw.kovidgoyal.net/kitty/keyboard-protocol) report releases: there a key moves the robot as long as it
is down.
"""

import re
from enum import Enum
from typing import Final

from console.steering import LETTERS, Direction, Steering, steering_of

TAP_S: Final = 0.3
"""How long a press counts where releases are not reported: beyond the usual interval of repeats (30 a
second), and short of the delay before the first."""

ASK_FOR_RELEASES: Final = "\x1b[?u\x1b[c"
"""Requests the protocol's flags, and then what every terminal answers (DA1), so that silence is an answer."""
BEGIN: Final = "\x1b[>11u\x1b[?1004h"
"""Escape codes for all keys, with their releases (1 + 2 + 8); then reports of the focus (xterm)."""
END: Final = "\x1b[?1004l\x1b[<u"
FOCUS_BEGIN: Final = "\x1b[?1004h"
FOCUS_END: Final = "\x1b[?1004l"

_SEQUENCE: Final = re.compile(
    r"\x1b\[(?P<parameters>[0-9:;?]*)(?P<final>[@-~])|\x1bO(?P<application>[A-Z])|(?P<character>.)", re.DOTALL
)
_UNFINISHED: Final = re.compile(r"\x1b(?:\[[0-9:;?]*|O)$")
_RELEASED: Final = "3"
"""The protocol's type of event; 1 is a press, 2 a repeat."""
_CONTROL: Final = 4
"""Bit of the protocol's modifiers, which are 1 more than their bits."""


class Action(Enum):
    """What a key does once, when it is pressed."""

    STOP = "stop"
    RESET = "reset"
    QUIT = "quit"


_ARROWS: Final = {
    "A": Direction.FORWARD,
    "B": Direction.BACK,
    "C": Direction.TURN_RIGHT,
    "D": Direction.TURN_LEFT,
}
ACTIONS: Final = {
    " ": Action.STOP,
    "r": Action.RESET,
    "x": Action.QUIT,
    "\x1b": Action.QUIT,
    "\x03": Action.QUIT,
}


def reports_releases(answer: str) -> bool | None:
    """Returns what an answer to ASK_FOR_RELEASES says; None before it is complete."""
    if re.search(r"\x1b\[\?[0-9;]*c", answer) is None:
        return None
    return re.search(r"\x1b\[\?[0-9]+u", answer) is not None


class Hands:
    """Which keys are down.

    Args:
        releases: Whether the terminal reports releases.
    """

    def __init__(self, *, releases: bool) -> None:
        self._releases = releases
        self._down: dict[Direction, float] = {}
        """When each was pressed, or repeated, last."""
        self._unfinished = ""

    def take(self, typed: str, now_s: float) -> list[Action]:
        """Takes what was typed; returns what is to be done once, in order."""
        typed = self._unfinished + typed
        unfinished = _UNFINISHED.search(typed)
        self._unfinished = unfinished[0] if unfinished else ""
        actions = []
        for found in _SEQUENCE.finditer(typed[: len(typed) - len(self._unfinished)]):
            action = self._key(found, now_s)
            if action:
                actions.append(action)
        return actions

    def release(self) -> None:
        """Releases all keys."""
        self._down.clear()

    def steering(self, now_s: float) -> Steering | None:
        """Returns what the keys that are down amount to; None with no key down."""
        if not self._releases:
            self._down = {key: at_s for key, at_s in self._down.items() if now_s - at_s < TAP_S}
        return steering_of(self._down)

    def _key(self, found: "re.Match[str]", now_s: float) -> Action | None:
        if found["character"]:
            return self._press(found["character"], now_s)
        if found["application"]:
            self._move(_ARROWS.get(found["application"]), now_s, released=False)
            return None
        return self._sequence(found["parameters"], found["final"], now_s)

    def _sequence(self, parameters: str, final: str, now_s: float) -> Action | None:
        if final == "O" and not parameters:
            self.release()  # The terminal has lost the focus: releases go elsewhere.
            return None
        code, _, modifiers = parameters.partition(";")
        bits, _, event = modifiers.partition(";")[0].partition(":")
        released = event == _RELEASED
        if final in _ARROWS:
            self._move(_ARROWS[final], now_s, released=released)
            return None
        number = code.partition(":")[0]
        if final != "u" or not number.isdigit():
            return None
        character = chr(int(number)) if int(number) < 0x110000 else ""
        if bits.isdigit() and (int(bits) - 1) & _CONTROL:
            return Action.QUIT if character == "c" else None
        if released:
            self._move(LETTERS.get(character), now_s, released=True)
            return None
        return self._press(character, now_s, repeated=event == "2")

    def _press(self, character: str, now_s: float, *, repeated: bool = False) -> Action | None:
        lowered = character.lower()
        self._move(LETTERS.get(lowered), now_s, released=False)
        return None if repeated else ACTIONS.get(lowered)

    def _move(self, direction: Direction | None, now_s: float, *, released: bool) -> None:
        if direction is None:
            return
        if released:
            self._down.pop(direction, None)
        else:
            self._down[direction] = now_s
