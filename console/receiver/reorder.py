"""Puts packets in the order of their numbers and waits a bounded time for missing ones. Pure."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

_NUMBERS: Final = 1 << 31
"""Packet sequence numbers have 31 bits and wrap around (draft-sharabayko-srt-01 3.1)."""
_HALF: Final = _NUMBERS >> 1
"""Numbers that are further ahead than that lie behind."""
CAPACITY: Final = 4096
"""Packets that may be held: 5 s of a stream at 8 Mbit/s, far more than the longest wait."""


@dataclass(frozen=True, slots=True)
class Delivered:
    """One packet in its place.

    Args:
        missing: packets directly before this one that were given up.
        payload: its content.
    """

    missing: int
    payload: bytes


class Reorder:
    """Orders packets; none is held longer than `wait_s`, and none is delivered twice.

    A packet is held while one before it is missing. Once the oldest held one has waited `wait_s`, or when
    the buffer is full, what is missing before it is given up; if it comes later, it is dropped.

    Args:
        first: number of the first packet.
        wait_s: longest wait; may be changed at any time.
        capacity: packets that may be held.
    """

    def __init__(self, first: int, wait_s: float, capacity: int = CAPACITY) -> None:
        self._next = first % _NUMBERS
        self._capacity = capacity
        self._held: dict[int, tuple[float, bytes]] = {}
        """Arrival and payload by number, in the order of arrival."""
        self.wait_s = wait_s
        self.waited = 0
        """Packets that had to wait for an earlier one."""
        self.given_up = 0
        """Packets that were not waited for any longer."""
        self.dropped = 0
        """Packets that came twice, or after they had been given up."""

    @property
    def held(self) -> int:
        """Packets that wait for an earlier one."""
        return len(self._held)

    @property
    def deadline_s(self) -> float | None:
        """When `expire` is due, on the clock of `put`; None when nothing is held."""
        return next(iter(self._held.values()))[0] + self.wait_s if self._held else None

    def put(self, number: int, payload: bytes, now_s: float) -> list[Delivered]:
        """Takes a packet; returns what is deliverable now, in order.

        Args:
            number: of the packet.
            payload: its content.
            now_s: time on any clock that does not go back.
        """
        if number == self._next and not self._held:
            self._next = (number + 1) % _NUMBERS
            return [Delivered(0, payload)]
        if (number - self._next) % _NUMBERS >= _HALF or number in self._held:
            self.dropped += 1
            return []
        self._held[number] = now_s, payload
        delivered = list(self._run())
        self.waited += number in self._held
        if len(self._held) > self._capacity:
            delivered += self._skip_to(min(self._held, key=self._distance))
        return delivered

    def expire(self, now_s: float) -> list[Delivered]:
        """Gives up what has been waited for long enough; returns what is deliverable then, in order."""
        delivered: list[Delivered] = []
        while self._held:
            number, (arrival_s, _) = next(iter(self._held.items()))
            if arrival_s + self.wait_s > now_s:
                break
            delivered += self._skip_to(number)
        return delivered

    def _skip_to(self, last: int) -> list[Delivered]:
        """Delivers everything held up to `last`, and what follows it without a gap."""
        delivered: list[Delivered] = []
        limit = self._distance(last)
        numbers = sorted((one for one in self._held if self._distance(one) <= limit), key=self._distance)
        for number in numbers:
            missing = self._distance(number)
            self.given_up += missing
            self._next = (number + 1) % _NUMBERS
            delivered.append(Delivered(missing, self._held.pop(number)[1]))
        delivered += self._run()
        return delivered

    def _run(self) -> Iterator[Delivered]:
        """Delivers what follows without a gap."""
        while entry := self._held.pop(self._next, None):
            self._next = (self._next + 1) % _NUMBERS
            yield Delivered(0, entry[1])

    def _distance(self, number: int) -> int:
        return (number - self._next) % _NUMBERS
