"""What typed characters mean; knows no terminal."""

import re
from collections.abc import Iterator
from enum import Enum
from typing import Final

from console.client import PreviewProfile


class Key(Enum):
    """A key that does something."""

    TOGGLE = "p"
    LOW_BW = "1"
    BALANCED = "2"
    HIGH_QUALITY = "3"
    QUIT = "q"


PROFILES: Final = {
    Key.LOW_BW: PreviewProfile.LOW_BW,
    Key.BALANCED: PreviewProfile.BALANCED,
    Key.HIGH_QUALITY: PreviewProfile.HIGH_QUALITY,
}
# What arrows, function keys and Alt with a letter send: there are letters and digits in it that nobody typed.
_SEQUENCE: Final = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]?|O.?|.)?", re.DOTALL)


def keys_in(typed: str) -> Iterator[Key]:
    """The keys among typed characters, in order; what means nothing is passed over."""
    meanings = {key.value: key for key in Key}
    for character in _SEQUENCE.sub("", typed).lower():
        if character in meanings:
            yield meanings[character]
