"""A UDP relay on this machine that behaves like a bad link: delay, loss and a bottleneck, each way."""

import heapq
import random
import selectors
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from types import TracebackType
from typing import Final, Generic, Self, TypeAlias, TypeVar

ItemT = TypeVar("ItemT")
_Sent: TypeAlias = tuple[socket.socket, bytes, tuple[str, int]]
"""The socket to send on, the payload, the address to send to."""

_MAX_WAITING: Final = 4096
"""Packets that wait in one direction; more are dropped, as by a full queue."""
_MAX_CALLERS: Final = 64
_KEPT: Final = 64
_LONGEST_PACKET: Final = 2048
_BUFFER_BYTES: Final = 1 << 22
_CONTROL: Final = 0x80
"""First bit of an SRT packet: set in control packets (draft-sharabayko-srt 3)."""


@dataclass(slots=True)
class Impairment:
    """Properties of a link, the same in both directions; may be changed while it is used.

    Args:
        loss: share of the packets that is lost, 0 to 1.
        control_loss: the same for SRT's control packets: acknowledgements, loss reports, handshakes.
        delay_s: propagation delay in one direction.
        rate_kbps: of the bottleneck; None for no bottleneck.
        queue_s: longest wait before the bottleneck; a packet that would wait longer is dropped.
        jitter_s: longest further delay, another one for each packet, so that packets overtake each other.
        duplicates: share of the packets that come twice, 0 to 1.
        drops: how many of the next data packets are lost, whatever `loss` is; counts down.
    """

    loss: float = 0.0
    control_loss: float = 0.0
    delay_s: float = 0.0
    rate_kbps: float | None = None
    queue_s: float = 0.2
    jitter_s: float = 0.0
    duplicates: float = 0.0
    drops: int = 0


class Direction:
    """One direction of a link: what becomes of each packet. Pure.

    Args:
        impairment: of the link.
        seed: of the random losses; the same seed loses the same packets.
    """

    def __init__(self, impairment: Impairment, seed: int) -> None:
        self._impairment = impairment
        self._random = random.Random(seed)
        self._free_at_s = 0.0
        """When the bottleneck has sent everything that it has accepted."""

    def arrival_s(self, packet: bytes, now_s: float) -> float | None:
        """Returns when a packet that is sent now arrives; None when it is lost.

        Args:
            packet: its UDP payload.
            now_s: seconds on any clock that does not go back.
        """
        link = self._impairment
        is_control = packet[:1] >= bytes([_CONTROL])
        if link.drops > 0 and not is_control:
            link.drops -= 1
            return None
        if self._random.random() < (link.control_loss if is_control else link.loss):
            return None
        begin_s = max(now_s, self._free_at_s)
        if link.rate_kbps is not None:
            if begin_s - now_s > link.queue_s:
                return None
            begin_s += len(packet) * 8 / (link.rate_kbps * 1000)
            self._free_at_s = begin_s
        return begin_s + link.delay_s + (self._random.uniform(0, link.jitter_s) if link.jitter_s else 0.0)

    @property
    def keeps_order(self) -> bool:
        """Whether no packet overtakes another one, also after a change of the delay."""
        return not self._impairment.jitter_s

    def is_duplicated(self) -> bool:
        """Returns whether the present packet comes once more."""
        share = self._impairment.duplicates
        return share > 0 and self._random.random() < share


class UdpLink:
    """Relays callers to a local UDP port until its block ends.

    Args:
        to_port: of the listener, at 127.0.0.1.
        impairment: of the link; kept, so that it may be changed.
        seed: of the random losses.
        at: address and port of the link; by default any port at 127.0.0.1.
        tap: takes each packet of the listener's before the link does anything to it, on the link's thread.
    """

    def __init__(
        self,
        to_port: int,
        impairment: Impairment | None = None,
        seed: int = 1,
        at: tuple[str, int] = ("127.0.0.1", 0),
        tap: Callable[[bytes], None] | None = None,
    ) -> None:
        self.impairment = impairment or Impairment()
        self.bytes_to_callers = 0
        """Of all packets that have arrived at callers so far."""
        self.recent: deque[bytes] = deque(maxlen=_KEPT)
        """The last packets that have arrived at callers."""
        self._tap = tap
        self._to = ("127.0.0.1", to_port)
        self._towards_listener = Line[_Sent](Direction(self.impairment, seed))
        self._towards_callers = Line[_Sent](Direction(self.impairment, seed + 1))
        self._front = _socket(at)
        self.port: int = self._front.getsockname()[1]
        self._backs: dict[tuple[str, int], socket.socket] = {}
        """By caller, so that the listener sees each as a peer of its own."""
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._front, selectors.EVENT_READ)
        self._stop_here, self._stop_there = socket.socketpair()
        self._selector.register(self._stop_here, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._run, name="UDP link")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop_there.send(b"x")
        self._thread.join(10)
        self._selector.close()
        for each in (self._front, self._stop_here, self._stop_there, *self._backs.values()):
            each.close()

    def inject(self, packet: bytes) -> None:
        """Sends a datagram of its own to every caller, from the listener's address."""
        for caller in list(self._backs):
            self._front.sendto(packet, caller)

    def _run(self) -> None:
        lines = self._towards_listener, self._towards_callers
        while True:
            for key, _ in self._selector.select(next_arrival_in_s(*lines)):
                if key.fileobj is self._stop_here:
                    return
                if key.fileobj is self._front:
                    self._from_caller()
                else:
                    self._from_listener(key.data)
            now_s = time.monotonic()
            for sender, packet, _ in self._towards_listener.arrived(now_s):
                sender.sendto(packet, self._to)
            for sender, packet, caller in self._towards_callers.arrived(now_s):
                self.bytes_to_callers += len(packet)
                self.recent.append(packet)
                sender.sendto(packet, caller)

    def _from_caller(self) -> None:
        packet, caller = self._front.recvfrom(_LONGEST_PACKET)
        if caller not in self._backs:
            if len(self._backs) >= _MAX_CALLERS:
                return
            self._backs[caller] = _socket()
            self._selector.register(self._backs[caller], selectors.EVENT_READ, caller)
        self._towards_listener.send(packet, (self._backs[caller], packet, self._to))

    def _from_listener(self, caller: tuple[str, int]) -> None:
        packet = self._backs[caller].recv(_LONGEST_PACKET)
        if self._tap:
            self._tap(packet)
        self._towards_callers.send(packet, (self._front, packet, caller))


class Line(Generic[ItemT]):
    """What is on its way in one direction of a link, in the order in which it arrives.

    Args:
        direction: what becomes of each packet.
    """

    def __init__(self, direction: Direction) -> None:
        self._direction = direction
        self._waiting: list[tuple[float, int, ItemT]] = []
        """A heap: when each arrives, and how many were sent before it."""
        self._numbers = count()
        self._latest_s = float("-inf")

    @property
    def next_s(self) -> float | None:
        """When the next one arrives."""
        return self._waiting[0][0] if self._waiting else None

    def send(self, packet: bytes, item: ItemT) -> None:
        """Takes the item that stands for a packet, unless the packet is lost."""
        for _ in range(1 + self._direction.is_duplicated()):
            arrival_s = self._direction.arrival_s(packet, time.monotonic())
            if arrival_s is not None and len(self._waiting) < _MAX_WAITING:
                if self._direction.keeps_order:
                    arrival_s = self._latest_s = max(self._latest_s, arrival_s)
                heapq.heappush(self._waiting, (arrival_s, next(self._numbers), item))

    def arrived(self, now_s: float) -> list[ItemT]:
        """Removes and returns what has arrived."""
        found = []
        while self._waiting and self._waiting[0][0] <= now_s:
            found.append(heapq.heappop(self._waiting)[2])
        return found


def next_arrival_in_s(*lines: Line[ItemT]) -> float | None:
    """Returns in how many seconds something arrives on one of the lines; None while nothing is on its way."""
    next_s = min((line.next_s for line in lines if line.next_s is not None), default=None)
    return None if next_s is None else max(0.0, next_s - time.monotonic())


def _socket(at: tuple[str, int] = ("127.0.0.1", 0)) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    # As long as the kernel permits: the link itself loses nothing while its thread stands still.
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
    made.bind(at)
    return made
