"""Counts that outlive the processes they come from."""

from dataclasses import dataclass, fields, replace
from typing import Final

from gateway.status.preview import Counters

_ZERO: Final = Counters()


@dataclass(slots=True)
class Ledger:
    """Adds up what every process of the preview service counted while this gateway ran.

    The first process may be older than the gateway: what it had counted before is not ours. Any later one
    began after it, so all it counted is. The gateway adds what only it can see: that the preview became
    faulted because the service is gone, and that a new process was told to start what an old one ran.
    """

    total: Counters = _ZERO
    _instance_id: str | None = None
    _seen: Counters = _ZERO
    _start_is_restart: bool = False

    def heard(self, instance_id: str, counters: Counters) -> None:
        """Takes in what the process counted so far; hearing the same twice adds nothing."""
        if self._instance_id is None:
            self._seen = counters
        elif instance_id != self._instance_id:
            self._seen = _ZERO
        self._instance_id = instance_id

        news = _minus(counters, self._seen)
        self._seen = counters
        if self._start_is_restart and news.starts:
            self._start_is_restart = False
            # The new process doesn't know that it continues what another one began.
            news = replace(news, restarts=min(news.restarts + 1, news.starts))
        self.total = _plus(self.total, news)

    def next_start_is_restart(self) -> None:
        """A wish that had been applied was given to a new process: its first start is a restart."""
        self._start_is_restart = True

    def fault(self) -> None:
        """The preview became faulted by the gateway's own verdict."""
        self.total = replace(self.total, faults=self.total.faults + 1)


def _plus(left: Counters, right: Counters) -> Counters:
    return Counters(*(getattr(left, each.name) + getattr(right, each.name) for each in fields(Counters)))


def _minus(left: Counters, right: Counters) -> Counters:
    """Never below zero: a count that went down is a defect of the service, and ours only grow."""
    return Counters(
        *(max(0, getattr(left, each.name) - getattr(right, each.name)) for each in fields(Counters))
    )
