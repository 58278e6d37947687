"""Double of twist_mux: which source of velocities reaches the base. Pure.

Like the real one it forwards a message on receipt or not at all: its timeouts and its lock send no zero.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final


@dataclass(frozen=True, slots=True)
class _Rank:
    priority: int
    timeout_s: float = 0.5


class MuxInput(Enum):
    """The inputs, as the first robot configures them; the joystick is wired to the mux, on no topic."""

    NAVIGATION = _Rank(1)
    AUTONOMY = _Rank(2)
    KEYBOARD = _Rank(3)
    JOYSTICK = _Rank(10)


LOCK_PRIORITY: Final = 255
"""Of the lock: above all inputs."""


class Mux:
    """Forwards the input of highest priority that is neither silent nor locked."""

    def __init__(self) -> None:
        self._received_s: dict[MuxInput, float] = {}
        self.locked = False

    def forwards(self, source: MuxInput, now_s: float) -> bool:
        """Takes a message of `source`; returns whether the base gets it."""
        self._received_s[source] = now_s
        heard = [
            each
            for each, at_s in self._received_s.items()
            if now_s - at_s <= each.value.timeout_s
            and not (self.locked and each.value.priority < LOCK_PRIORITY)
        ]
        return bool(heard) and max(heard, key=lambda each: each.value.priority) is source
