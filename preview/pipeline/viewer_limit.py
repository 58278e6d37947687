"""Limit on the viewers of a pipeline: more are refused in SRT's handshake.

libsrt asks before the connection exists, on a thread that must not block; srtsink reports it a little later,
or never: a wrong passphrase ends a handshake afterwards. So a caller that was admitted is pending until it
has connected, or for as long as a handshake may take.

Pending callers are no viewers yet, and strangers without the passphrase can be nothing else. Those of one
host are few, and those of hosts that have never watched, taken together, take no place of the others.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

HANDSHAKE_S: Final = 3.0
"""SRTO_CONNTIMEO: a caller gives up after it."""
HANDSHAKES_OF_HOST: Final = 8
"""Pending at once."""
HANDSHAKES_OF_STRANGERS: Final = 16
"""Pending at once, of all hosts that have not watched yet. So many viewers beyond the limit may connect if
they all know the passphrase."""
REPEATS: Final = 16
"""Requests of one address in the time of a handshake: a caller repeats its own every 250 ms. libsrt may take
each for another connection."""
_MAX_KNOWN_HOSTS: Final = 256
"""That have watched; beyond it the one that was first is forgotten."""


@dataclass(slots=True)
class _Pending:
    host: str
    until_s: float
    requests: int = 1


class ViewerLimit:
    """Answers and counts the callers of a listener.

    Args:
        sink: the listener. It references this object, not the other way round.
        limit: most viewers at once.
        clock: seconds, monotonic.
    """

    def __init__(self, sink: Any, limit: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._limit = limit
        self._clock = clock
        self._lock = threading.Lock()
        self._viewers: set[str] = set()
        """Addresses of those that are connected."""
        self._pending: dict[str, _Pending] = {}
        """By address."""
        self._known_hosts: dict[str, None] = {}
        self._refused = 0
        # Without it, srtsink does not ask.
        sink.set_property("authentication", True)
        sink.connect("caller-connecting", lambda _sink, caller, _stream_id: self._admit(address_of(caller)))
        sink.connect("caller-added", lambda _sink, _number, caller: self._add(address_of(caller)))
        sink.connect("caller-removed", lambda _sink, _number, caller: self._remove(address_of(caller)))

    def take_refused(self) -> int:
        """Returns how many callers were refused since the last call."""
        with self._lock:
            refused, self._refused = self._refused, 0
        return refused

    def _admit(self, address: str) -> bool:
        now_s = self._clock()
        with self._lock:
            self._pending = {a: each for a, each in self._pending.items() if each.until_s > now_s}
            pending = self._pending.get(address)
            if pending:
                pending.requests += 1
                admitted = pending.requests <= REPEATS
            else:
                admitted = address in self._viewers or self._has_room_for(_host_of(address))
                if admitted:
                    self._pending[address] = _Pending(_host_of(address), now_s + HANDSHAKE_S)
            self._refused += not admitted
        return admitted

    def _has_room_for(self, host: str) -> bool:
        """Returns whether one more caller of this host may begin a handshake."""
        # A request that a viewer repeats may arrive after it has connected: it is counted among the viewers.
        pending = [each.host for address, each in self._pending.items() if address not in self._viewers]
        of_known = sum(each in self._known_hosts for each in pending)
        if len(self._viewers) + of_known >= self._limit or pending.count(host) >= HANDSHAKES_OF_HOST:
            return False
        return host in self._known_hosts or len(pending) - of_known < HANDSHAKES_OF_STRANGERS

    def _add(self, address: str) -> None:
        host = _host_of(address)
        with self._lock:
            self._pending.pop(address, None)
            self._viewers.add(address)
            self._known_hosts.pop(host, None)
            self._known_hosts[host] = None
            if len(self._known_hosts) > _MAX_KNOWN_HOSTS:
                del self._known_hosts[next(iter(self._known_hosts))]

    def _remove(self, address: str) -> None:
        with self._lock:
            self._viewers.discard(address)
            self._pending.pop(address, None)


def address_of(socket_address: Any) -> str:
    """Returns "HOST:PORT" of a socket address."""
    return f"{socket_address.get_address().to_string()}:{socket_address.get_port()}" if socket_address else ""


def _host_of(address: str) -> str:
    return address.rpartition(":")[0]
