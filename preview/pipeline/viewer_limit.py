"""Limit on the viewers of a pipeline: more are refused in SRT's handshake.

libsrt asks before the connection exists, on a thread that must not block; srtsink reports it a little later,
or never: a wrong passphrase ends a handshake afterwards. So a caller that was admitted counts as a viewer
until it has connected, or for as long as a handshake may take.
"""

import threading
import time
from typing import Any, Final

_HANDSHAKE_S: Final = 3.0
"""SRTO_CONNTIMEO: a caller gives up after it."""


class ViewerLimit:
    """Answers and counts the callers of a listener.

    Args:
        sink: the listener. It references this object, not the other way round.
        limit: most viewers at once.
    """

    def __init__(self, sink: Any, limit: int) -> None:
        self._limit = limit
        self._lock = threading.Lock()
        self._viewers: dict[str, float] = {}
        """By address: until when each one counts, in monotonic seconds."""
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
        now = time.monotonic()
        with self._lock:
            self._viewers = {a: until for a, until in self._viewers.items() if until > now}
            # A caller repeats its request until it gets an answer.
            admitted = address in self._viewers or len(self._viewers) < self._limit
            if admitted:
                self._viewers.setdefault(address, now + _HANDSHAKE_S)
            else:
                self._refused += 1
        return admitted

    def _add(self, address: str) -> None:
        with self._lock:
            self._viewers[address] = float("inf")

    def _remove(self, address: str) -> None:
        with self._lock:
            self._viewers.pop(address, None)


def address_of(socket_address: Any) -> str:
    """Returns "HOST:PORT" of a socket address."""
    return f"{socket_address.get_address().to_string()}:{socket_address.get_port()}" if socket_address else ""
