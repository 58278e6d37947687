"""Alarm about active faults and a lost connection, and their acknowledgement. Pure."""

from collections.abc import Mapping, Sequence
from typing import Final, TypeAlias

from console.client.results import Fault, FaultSeverity

REPEAT_S: Final = 3.0
"""Period of the sound while anything waits for its acknowledgement."""
_RANKS: Final[Mapping[FaultSeverity, int]] = {FaultSeverity.WARNING: 1, FaultSeverity.ERROR: 2}
"""The severities that alarm; the higher one alarms again about a fault that was acknowledged at the lower."""

Occurrence: TypeAlias = tuple[str, int]
"""A fault's id, and how often it was raised: one that comes back is another occurrence."""
LOST_LINK: Final[Occurrence] = ("", 0)
"""The lost connection: no fault of the robot has an empty id, or was never raised."""


def occurrence(fault: Fault) -> Occurrence:
    """Returns the occurrence of a fault."""
    return (fault.id, fault.times_raised)


class Alarm:
    """Decides when the sound is played, and remembers what was acknowledged.

    An acknowledgement lasts until the fault becomes more severe, or is cleared and raised again; that of a
    lost connection until the robot answers.
    """

    def __init__(self) -> None:
        self.sound_on = False
        """Whether the operator wants to hear alarms."""
        self._active: Mapping[Occurrence, int] = {}
        """Ranks of what alarms."""
        self._acknowledged: Mapping[Occurrence, int] = {}
        """Ranks at which it was acknowledged."""
        self._sounded_s: float | None = None

    def show(self, faults: Sequence[Fault], *, link_lost: bool = False) -> list[Fault]:
        """Takes the present state.

        Args:
            faults: Of the latest status.
            link_lost: Whether the robot has not answered for too long.

        Returns:
            The alarming faults that are new, or more severe than they were.
        """
        before = self._active
        alarming = [fault for fault in faults if fault.active and fault.severity in _RANKS]
        active = {occurrence(fault): _RANKS[fault.severity] for fault in alarming}
        self._active = active | ({LOST_LINK: _RANKS[FaultSeverity.ERROR]} if link_lost else {})
        # One that became less severe was acknowledged as that: the next rise alarms again.
        self._acknowledged = {
            each: min(rank, self._active[each])
            for each, rank in self._acknowledged.items()
            if each in self._active
        }
        return [fault for fault in alarming if active[occurrence(fault)] > before.get(occurrence(fault), 0)]

    def is_pending(self, which: Occurrence) -> bool:
        """Whether a fault, or the lost connection, is active and waits for its acknowledgement."""
        return self._active.get(which, 0) > self._acknowledged.get(which, 0)

    @property
    def pending(self) -> int:
        """How many of them wait for their acknowledgement."""
        return sum(map(self.is_pending, self._active))

    def acknowledge(self, *which: Occurrence) -> None:
        """Acknowledges these; all of them if none is named."""
        seen = {each: rank for each, rank in self._active.items() if not which or each in which}
        self._acknowledged = {**self._acknowledged, **seen}

    def due(self, now_s: float) -> bool:
        """Whether the sound is to be played now; then it is due again after REPEAT_S."""
        if not (self.sound_on and self.pending):
            self._sounded_s = None
            return False
        if self._sounded_s is not None and now_s - self._sounded_s < REPEAT_S:
            return False
        self._sounded_s = now_s
        return True
