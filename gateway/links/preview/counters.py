"""Counters that outlive the processes of the preview service."""

from dataclasses import astuple, dataclass, field, replace
from operator import add, sub

from gateway.status.preview import Counters


@dataclass(slots=True)
class CounterTotals:
    """Sums of what all processes of the preview service counted while this gateway ran.

    The first process may be older than the gateway: what it had counted before is left out. Any later one
    started after the gateway, so all of its counts belong. The gateway adds what it alone can see: that the
    preview became faulted because the service is gone, and that a new process starts what an old one ran.
    """

    total: Counters = field(default_factory=Counters)
    _instance_id: str | None = None
    _last: Counters = field(default_factory=Counters)
    _start_is_restart: bool = False

    def take(self, instance_id: str, counters: Counters) -> None:
        """Adds what the process has counted since its last report; a repeated report adds nothing."""
        if instance_id != self._instance_id:
            self._last = counters if self._instance_id is None else Counters()
            self._instance_id = instance_id
        # Not below 0: a counter that went down is a defect of the service, and totals only grow.
        changes = map(sub, astuple(counters), astuple(self._last))
        added = Counters(*(max(0, change) for change in changes))
        self._last = counters
        if self._start_is_restart and added.starts:
            self._start_is_restart = False
            # The new process cannot know that it continues what another one started.
            added = replace(added, restarts=min(added.restarts + 1, added.starts))
        self.total = Counters(*map(add, astuple(self.total), astuple(added)))

    def next_start_is_restart(self) -> None:
        """Counts the next start as a restart: what had been applied is applied to a new process."""
        self._start_is_restart = True

    def add_fault(self) -> None:
        """Counts a fault that the gateway found, not the service."""
        self.total = replace(self.total, faults=self.total.faults + 1)
