"""The account of connections under any sequence of events, compared with a model of what it promises."""

from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Final

from common.errors import TooMuchError
from gateway.config import LimitSettings
from gateway.rpc.calls.call import Peer, peer_of
from gateway.rpc.connections.admission import PENDING_S, PENDING_STREAMS, SPARED_S, Admission

_LIMITS: Final = LimitSettings(
    connections=6, connections_per_address=4, streams_per_connection=2, requests_per_s=2, burst=4
)
_HOSTS: Final = tuple(f"10.0.0.{number}" for number in range(8))
_TICK_S: Final = 0.125
_MAX_CONNECTIONS: Final = 32
_MAX_PENDING: Final = _MAX_CONNECTIONS // 4


class Model:
    """A server of which every connection is known.

    Attributes:
        present: addresses of the connections that there are.
        served: those of them that were admitted and have not been dismissed since; some may have lost their
            place to another.
        streams: open ones, by address.
    """

    def __init__(self) -> None:
        self._now_s = 1000.0
        self._admission = Admission(_LIMITS, lambda: self._now_s, max_connections=_MAX_CONNECTIONS)
        self.present: dict[str, float] = {}
        self.served: set[str] = set()
        self.streams: Counter[str] = Counter()
        self._next_port = 1000

    def connect(self, number: int) -> None:
        """A few connections of one address; without a call, only a scan sees them."""
        host = _HOSTS[number % len(_HOSTS)]
        for _ in range(1 + number // len(_HOSTS)):
            self.present[f"{host}:{self._next_port}"] = -1.0
            self._next_port += 1

    def admitted_call(self, number: int) -> None:
        """A call with a valid credential; there may be no place for it."""
        if (peer := self._chosen(number)) and self._takes_token(peer):
            with suppress(TooMuchError):
                self._admission.admit(peer)
                self.served.add(peer.address)

    def refused_call(self, number: int) -> None:
        """A call with a wrong credential."""
        if (peer := self._chosen(number)) and self._takes_token(peer):
            self._admission.dismiss(peer)
            if peer.address in self.served:
                self.served.discard(peer.address)
                self.present[peer.address] = self._now_s

    def open_stream(self, number: int) -> None:
        """A stream, if the connection may have one more."""
        peer = self._chosen(number)
        if peer is None or not self._takes_token(peer):
            return
        try:
            self._admission.open_stream(peer)
        except TooMuchError:
            assert self.streams[peer.address] >= min(_LIMITS.streams_per_connection, PENDING_STREAMS)
            return
        if peer.address in self.served:
            try:
                self._admission.admit(peer)
            except TooMuchError:
                self._admission.close_stream(peer)
                # Another one had taken its place since it was last served: pending since then.
                self.served.discard(peer.address)
                self.present[peer.address] = self._now_s
                return
        self.streams[peer.address] += 1
        assert self.streams[peer.address] <= _LIMITS.streams_per_connection

    def close_stream(self, number: int) -> None:
        """The end of one."""
        if (peer := self._chosen(number)) and self.streams[peer.address]:
            self._admission.close_stream(peer)
            self.streams[peer.address] -= 1

    def disconnect(self, number: int) -> None:
        """The end of a connection: of its streams and refusals first."""
        if peer := self._chosen(number):
            self._end(peer)

    def wait(self, number: int) -> None:
        """Time passes."""
        self._now_s += number * _TICK_S

    def scan(self, _number: int) -> None:
        """The guard looks, and closes what it is to close."""
        for address, seen_s in self.present.items():
            if seen_s < 0:
                self.present[address] = self._now_s
        surplus = self._admission.surplus(list(self.present))
        assert len(set(surplus)) == len(surplus)
        busy = {address for address in self.served if self.streams[address]}
        for address in surplus:
            assert address in self.present
            assert address not in busy, "a place with an open stream is no one else's"
            self._end(_peer(address))
        strangers = {
            address: since_s for address, since_s in self.present.items() if address not in self.served
        }
        assert len(strangers) <= _MAX_PENDING
        settled = [address for address, since_s in strangers.items() if self._now_s - since_s > SPARED_S]
        hosts = Counter(address.rpartition(":")[0] for address in settled)
        assert all(count <= _MAX_PENDING // 2 for count in hosts.values())
        assert all(self._now_s - since_s <= PENDING_S for since_s in strangers.values())

    def _end(self, peer: Peer) -> None:
        for _ in range(self.streams.pop(peer.address, 0)):
            self._admission.close_stream(peer)
        self.served.discard(peer.address)
        del self.present[peer.address]

    def _takes_token(self, peer: Peer) -> bool:
        try:
            self._admission.take_token(peer)
        except TooMuchError:
            return False
        return True

    def _chosen(self, number: int) -> Peer | None:
        if not self.present:
            return None
        return _peer(list(self.present)[number % len(self.present)])


_EVENTS: Final[Mapping[int, Callable[[Model, int], None]]] = dict(
    enumerate(
        (
            Model.connect,
            Model.admitted_call,
            Model.refused_call,
            Model.open_stream,
            Model.close_stream,
            Model.disconnect,
            Model.wait,
            Model.scan,
        )
    )
)


def admission(data: bytes) -> None:
    """Two bytes are an event: which, and a number for it."""
    model = Model()
    for which, number in zip(data[::2], data[1::2], strict=False):
        _EVENTS[which % len(_EVENTS)](model, number)
    model.scan(0)


def _peer(address: str) -> Peer:
    return peer_of(f"ipv4:{address}")
