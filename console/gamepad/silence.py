"""A gamepad without a cable that reports nothing new. Pure.

Out of range, or with an empty battery, its last values stay: the kernel keeps them until the link is given
up, which takes Bluetooth up to 20 s (its supervision timeout). A stick at its end and a button that is held
look the same.
"""

from typing import Final

from console.gamepad.hands import PadInput

HELD_FOR_S: Final = 2.0
"""How long such a gamepad holds without any change of a stick, trigger or button. A thumb on a stick mostly
moves it by more than the resolution within that, unless the stick is at its end."""
SILENT: Final = (
    f"the gamepad has reported nothing new for {HELD_FOR_S:g} s, as when it is out of range: "
    "let it go, then hold it again; with a cable it may be held still"
)


class Silence:
    """Follows whether anything of a gamepad changes. One with a cable is never silent."""

    def __init__(self) -> None:
        self._values: tuple[int, ...] = ()
        self._changed_s = 0.0

    def take(self, pad: PadInput | None, now_s: float) -> bool:
        """Takes the present input; returns whether a hold counts no more."""
        values = pad.values if pad else ()
        if pad is None or not pad.wireless or values != self._values:
            self._values, self._changed_s = values, now_s
        return now_s - self._changed_s > HELD_FOR_S
