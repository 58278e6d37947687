"""The relay for TCP: what it delays."""

import socket
import threading
import time
from collections.abc import Iterator

import pytest

from tests.support.bad_links import Relay

DELAY_S = 0.05


@pytest.fixture
def port() -> Iterator[int]:
    """A server that answers one caller with what it says."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def answer() -> None:
            caller, _ = listener.accept()
            with caller:
                while data := caller.recv(1024):
                    caller.sendall(data)

        thread = threading.Thread(target=answer)
        thread.start()
        yield listener.getsockname()[1]
        thread.join(10)


@pytest.mark.parametrize("delay_s", [0.0, DELAY_S])
def test_each_way_takes_its_time(port: int, delay_s: float) -> None:
    with Relay(port, delay_s) as relay, socket.create_connection(("127.0.0.1", relay.port), 10) as caller:
        for word in (b"one", b"two"):
            begun_s = time.monotonic()
            caller.sendall(word)
            assert caller.recv(1024) == word
            assert time.monotonic() - begun_s >= 2 * delay_s
