"""Events and gaps in their order, and batches of them. Pure values."""

from dataclasses import dataclass
from enum import IntEnum

INFO = 1
"""FaultSeverity of the contract: FAULT_SEVERITY_INFO."""


class DropReason(IntEnum):
    """Why events are missing, with the numbers of omniseer.fleet.v1.DropReason."""

    UNKNOWN = 0
    OUTBOX_FULL = 1
    NO_LONGER_KEPT = 2
    DISK = 3
    OUTBOX_LOST = 4


@dataclass(frozen=True, slots=True)
class Position:
    """A place in the order of events: after the event with this sequence of this run of the gateway."""

    run_id: str
    sequence: int


@dataclass(frozen=True, slots=True)
class Event:
    """An event of the gateway.

    Attributes:
        severity: number of FaultSeverity.
        payload: omniseer.gateway.v1.Event, serialised.
    """

    run_id: str
    sequence: int
    severity: int
    payload: bytes

    @property
    def first(self) -> int:
        """Its sequence; events and gaps are alike in having a first and a last one."""
        return self.sequence

    @property
    def last(self) -> int:
        """Its sequence."""
        return self.sequence


@dataclass(frozen=True, slots=True)
class Gap:
    """Events are missing: those with the sequences `first` to `last`; none where `last` is before `first`.

    Attributes:
        worst: the highest severity among them; 0 if it is not known.
        earlier: whether an earlier run's last events are missing as well. Such a gap begins its run at 1.
        probes: how often it may be sent as a shorter one when the hub has something else in its place; see
            `Database.delivered`.
    """

    run_id: str
    first: int
    last: int
    reason: DropReason
    worst: int = 0
    earlier: bool = False
    probes: int = 0

    @property
    def count(self) -> int:
        """Events of its run that are missing."""
        return self.last - self.first + 1


Item = Event | Gap


@dataclass(frozen=True, slots=True)
class Batch:
    """Items of one run without a hole between them: what is sent at once, and repeated as it is."""

    items: tuple[Item, ...]
    first_id: int
    """Row of its first item."""
    last_id: int

    @property
    def run_id(self) -> str:
        """Of all items."""
        return self.items[0].run_id

    @property
    def first(self) -> int:
        """Its first sequence, which no other batch of the run has.

        0, the place before the first event, if an earlier run's events are missing there.
        """
        head = self.items[0]
        return 0 if isinstance(head, Gap) and head.earlier else head.first

    @property
    def last(self) -> int:
        """Sequence of the last item."""
        return self.items[-1].last

    @property
    def events(self) -> int:
        """Number of events."""
        return sum(isinstance(each, Event) for each in self.items)
