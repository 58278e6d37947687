"""A server that takes connections and never says anything, as one that stands still."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager

import pytest


@contextmanager
def silent_server() -> Iterator[str]:
    """Yields its address, as of a NATS server; the kernel takes the connections, and nothing reads them."""
    with socket.create_server(("127.0.0.1", 0), backlog=64) as listening:
        yield f"nats://127.0.0.1:{listening.getsockname()[1]}"


def tried_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """Has the servers of a hub tried as they are listed; a silent one is waited for a minute, not 5 s."""
    monkeypatch.setattr("fleet.connection.random.shuffle", lambda _servers: None)
    monkeypatch.setattr("fleet.nats_client.CONNECT_TIMEOUT_S", 60.0)
