"""Counters that outlive the processes of the preview service."""

from dataclasses import dataclass, fields, replace
from typing import Final

from gateway.status.preview import Counters

_ZERO: Final = Counters()


@dataclass(slots=True)
class CounterTotals:
    """Sums of what all processes of the preview service counted while this gateway ran.

    The first process may be older than the gateway: what it had counted before is left out. Any later one
    started after the gateway, so all of its counts belong. The gateway adds what it alone can see: that the
    preview became faulted because the service is gone, and that a new process starts what an old one ran.
    """

    total: Counters = _ZERO
    _instance_id: str | None = None
    _last: Counters = _ZERO
    _start_is_restart: bool = False

    def take(self, instance_id: str, counters: Counters) -> None:
        """Adds what the process has counted since its last report; a repeated report adds nothing."""
        if self._instance_id is None:
            self._last = counters
        elif instance_id != self._instance_id:
            self._last = _ZERO
        self._instance_id = instance_id

        added = _minus(counters, self._last)
        self._last = counters
        if self._start_is_restart and added.starts:
            self._start_is_restart = False
            # The new process cannot know that it continues what another one started.
            added = replace(added, restarts=min(added.restarts + 1, added.starts))
        self.total = _plus(self.total, added)

    def next_start_is_restart(self) -> None:
        """Has the next start counted as a restart: what had been applied is applied to a new process."""
        self._start_is_restart = True

    def add_fault(self) -> None:
        """Counts a fault that the gateway found, not the service."""
        self.total = replace(self.total, faults=self.total.faults + 1)


def _plus(left: Counters, right: Counters) -> Counters:
    return Counters(*(getattr(left, each.name) + getattr(right, each.name) for each in fields(Counters)))


def _minus(left: Counters, right: Counters) -> Counters:
    """Never below zero: a counter that went down is a defect of the service, and totals only grow."""
    return Counters(
        *(max(0, getattr(left, each.name) - getattr(right, each.name)) for each in fields(Counters))
    )
