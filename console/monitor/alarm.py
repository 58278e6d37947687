"""Alarm about active faults, and their acknowledgement. Pure."""

from collections.abc import Sequence
from typing import Final, TypeAlias

from console.client.results import Fault, FaultSeverity

REPEAT_S: Final = 3.0
"""Period of the sound while a fault is not acknowledged."""
_ALARMING: Final = (FaultSeverity.ERROR, FaultSeverity.WARNING)

Occurrence: TypeAlias = tuple[str, int]
"""A fault's id, and how often it was raised: one that comes back is another occurrence."""


def occurrence(fault: Fault) -> Occurrence:
    """Returns the occurrence of a fault."""
    return (fault.id, fault.times_raised)


class Alarm:
    """Decides when the sound is played, and remembers what was acknowledged.

    An acknowledgement lasts until the fault is cleared and raised again.
    """

    def __init__(self) -> None:
        self.sound_on = False
        """Whether the operator wants to hear alarms."""
        self._acknowledged: frozenset[Occurrence] = frozenset()
        self._pending: frozenset[Occurrence] = frozenset()
        self._sounded_s: float | None = None

    def show_faults(self, faults: Sequence[Fault]) -> list[Fault]:
        """Takes the faults of the latest status. Returns the alarming ones that were not there before."""
        alarming = [fault for fault in faults if fault.active and fault.severity in _ALARMING]
        active = frozenset(map(occurrence, alarming))
        before = self._pending | self._acknowledged
        self._acknowledged &= active
        self._pending = active - self._acknowledged
        return [fault for fault in alarming if occurrence(fault) not in before]

    def is_pending(self, fault: Fault) -> bool:
        """Whether a fault is active and waits for its acknowledgement."""
        return occurrence(fault) in self._pending

    @property
    def pending(self) -> int:
        """How many faults wait for their acknowledgement."""
        return len(self._pending)

    def acknowledge(self, *which: Occurrence) -> None:
        """Acknowledges these faults; all of them if none is named."""
        done = self._pending & frozenset(which) if which else self._pending
        self._acknowledged |= done
        self._pending -= done

    def due(self, now_s: float) -> bool:
        """Whether the sound is to be played now; then it is due again after REPEAT_S."""
        if not (self.sound_on and self._pending):
            self._sounded_s = None
            return False
        if self._sounded_s is not None and now_s - self._sounded_s < REPEAT_S:
            return False
        self._sounded_s = now_s
        return True
