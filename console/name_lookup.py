"""Resolves host names within a bounded time: the system's resolver takes no timeout."""

import queue
import socket
import threading
import time
from typing import Any, Final, TypeAlias

_POLL_S: Final = 0.05
_NEVER: Final = threading.Event()

Addresses: TypeAlias = list[Any]
"""As `socket.getaddrinfo` returns them."""


def resolve(
    host: str,
    port: int | None,
    kind: socket.SocketKind,
    within_s: float,
    cancelled: threading.Event = _NEVER,
) -> Addresses:
    """Returns the addresses of a host; at least one.

    Args:
        host: name or address.
        port: of the service; None leaves it open.
        kind: of socket.
        within_s: longest wait. The resolver itself goes on in its thread, which keeps no program from ending.
        cancelled: ends the wait early.

    Raises:
        OSError: the name is unknown, or can't be one.
        TimeoutError: no answer in time, or cancelled.
    """
    outcome: queue.SimpleQueue[Addresses | OSError] = queue.SimpleQueue()
    look_up = threading.Thread(
        target=_look_up, args=(host, port, kind, outcome), name="resolver", daemon=True
    )
    look_up.start()
    deadline_s = time.monotonic() + within_s
    while not cancelled.is_set() and time.monotonic() < deadline_s:
        try:
            found = outcome.get(timeout=_POLL_S)
        except queue.Empty:
            continue
        if isinstance(found, OSError):
            raise found
        return found
    raise TimeoutError(f"no answer within {within_s:g} s")


def _look_up(
    host: str, port: int | None, kind: socket.SocketKind, outcome: "queue.SimpleQueue[Addresses | OSError]"
) -> None:
    try:
        outcome.put(socket.getaddrinfo(host, port, type=kind))
    except OSError as error:
        outcome.put(error)
    except UnicodeError as error:
        outcome.put(OSError(f"no name of a host: {error}"))
