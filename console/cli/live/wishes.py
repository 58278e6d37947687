"""What the keys ask of the preview: one thing at a time, and what became of it."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from console.cli.live.keys import PROFILES, Key
from console.client import GatewayError, PreviewChange, PreviewProfile, PreviewState, PreviewStatus
from console.presentation.severity_style import SeverityStyle

_GOOD_FOR_S: Final = 5.0
_BAD_FOR_S: Final = 15.0
_WANTED: Final = (PreviewState.STARTING, PreviewState.RUNNING, PreviewState.FAULTED)


@dataclass(frozen=True, slots=True)
class Wish:
    """What is asked of the robot; `UNKNOWN` leaves the profile to it."""

    enabled: bool
    profile: PreviewProfile = PreviewProfile.UNKNOWN


@dataclass(frozen=True, slots=True)
class Note:
    """A sentence about the newest wish."""

    text: str
    style: SeverityStyle
    until_s: float = float("inf")


class Wishes:
    """From keys to wishes, and from outcomes to sentences. Knows no terminal and no robot.

    Args:
        clock: seconds, monotonic.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._under_way: Wish | None = None
        self._marked = PreviewProfile.UNKNOWN
        self._note: Note | None = None

    def press(self, key: Key, preview: PreviewStatus) -> Wish | None:
        """What to ask the robot now; None when there is nothing to ask."""
        if self._under_way:
            return None
        wish = self._meant(key, preview)
        if wish is None:
            self._say(
                f"{self._marked.value}: p turns the preview on with it", SeverityStyle.QUIET, _BAD_FOR_S
            )
            return None
        self._under_way = wish
        self._note = Note(f"{_in_words(wish)}: the robot is asked ...", SeverityStyle.QUIET)
        return wish

    def done(self, outcome: PreviewChange | GatewayError) -> None:
        """The robot has answered, or can't be asked."""
        wish, self._under_way = self._under_way, None
        assert wish
        if isinstance(outcome, GatewayError):
            self._say(f"{_in_words(wish)}: not done, {outcome}", SeverityStyle.BAD, _BAD_FOR_S)
        elif not outcome.accepted:
            self._say(
                f"{_in_words(wish)}: the robot refused: {outcome.message}", SeverityStyle.BAD, _BAD_FOR_S
            )
        elif outcome.preview.state is PreviewState.FAULTED:
            self._say(outcome.message, SeverityStyle.BAD, _BAD_FOR_S)
        else:
            self._marked = PreviewProfile.UNKNOWN
            self._say(outcome.message, SeverityStyle.QUIET, _GOOD_FOR_S)

    def note(self) -> Note | None:
        """What is to be said of the newest wish at this moment."""
        if self._note and self._clock() > self._note.until_s:
            self._note = None
        return self._note

    def help(self, preview: PreviewStatus) -> Iterator[tuple[Key, str, bool]]:
        """Each key, what it does now, and whether that is how it is already."""
        yield Key.TOGGLE, "preview off" if preview.state in _WANTED else "preview on", False
        marked = preview.profile if self._marked is PreviewProfile.UNKNOWN else self._marked
        for key, profile in PROFILES.items():
            yield key, profile.value, profile is marked
        yield Key.QUIT, "quit", False

    def _meant(self, key: Key, preview: PreviewStatus) -> Wish | None:
        on = preview.state in _WANTED
        if key is Key.TOGGLE:
            return Wish(False) if on else Wish(True, self._marked)
        if on:
            return Wish(True, PROFILES[key])
        self._marked = PROFILES[key]
        return None

    def _say(self, text: str, style: SeverityStyle, for_s: float) -> None:
        self._note = Note(text, style, self._clock() + for_s)


def _in_words(wish: Wish) -> str:
    if not wish.enabled:
        return "preview off"
    return "preview on" if wish.profile is PreviewProfile.UNKNOWN else f"preview {wish.profile.value}"
