"""What no client of ours would send: broken HTTP/2, too much of everything, and half connections."""

import random
import socket
import struct
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

from tests.support.http2 import (
    BEGINNING,
    CONTINUATION,
    DATA,
    END_HEADERS,
    GET_SYSTEM_STATUS,
    HEADERS,
    LONGEST_FRAME,
    PING,
    PREFACE,
    PRIORITY,
    RST_STREAM,
    SETTINGS,
    WINDOW_UPDATE,
    frame,
    literal,
)

PATIENCE_S = 10


def _continued(headers: bytes) -> bytes:
    """Headers of any size, in frames of the greatest size, without an end."""
    parts = [headers[at : at + LONGEST_FRAME] for at in range(0, len(headers), LONGEST_FRAME)]
    return frame(HEADERS, GET_SYSTEM_STATUS, stream=1) + b"".join(
        frame(CONTINUATION, each, stream=1) for each in parts
    )


def _taken_back(stream: int) -> bytes:
    """A call, and its end before it could be answered."""
    return frame(HEADERS, GET_SYSTEM_STATUS, stream=stream, flags=END_HEADERS) + frame(
        RST_STREAM, bytes(4), stream=stream
    )


CONVERSATIONS = {
    "noise": random.Random(7).randbytes(20_000),
    "an HTTP/1 request": b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n",
    "a TLS hello": bytes.fromhex("16030100a5010000a10303") + bytes(200),
    "noise after a good beginning": BEGINNING + random.Random(8).randbytes(20_000),
    "a frame that claims 16 MiB": BEGINNING + frame(DATA, b"x", stream=1, length=0xFFFFFF),
    "settings of a wrong size": PREFACE + frame(SETTINGS, b"12345"),
    "a window of nothing": BEGINNING + frame(WINDOW_UPDATE, bytes(4)),
    "windows that overflow": BEGINNING + frame(WINDOW_UPDATE, struct.pack(">I", 2**31 - 1)) * 3,
    "data of no stream": BEGINNING + frame(DATA, b"x" * 100),
    "headers of an even stream": BEGINNING + frame(HEADERS, GET_SYSTEM_STATUS, stream=2, flags=END_HEADERS),
    "many headers without an end": BEGINNING + _continued(literal(b"x", b"y" * 1000) * 4000),
    "a header of 4 MiB": BEGINNING + _continued(literal(b"big", b"z" * 4_000_000)),
    "a place of a table that is not there": BEGINNING
    + frame(HEADERS, b"\xff\xff\xff\x7f", stream=1, flags=END_HEADERS),
    "five thousand settings": PREFACE + frame(SETTINGS) * 5000,
    "five thousand pings": BEGINNING + frame(PING, bytes(8)) * 5000,
    "ten thousand calls, each taken back at once": BEGINNING
    + b"".join(_taken_back(stream) for stream in range(1, 20_000, 2)),
    "a stream that depends on itself": BEGINNING
    + frame(PRIORITY, struct.pack(">IB", 1, 255), stream=1) * 100,
}
"""By what they are; each goes over a connection of its own."""


def converse(port: int, said: bytes) -> None:
    """Says it, as far as the other side listens, then hears the other side out for a moment."""
    with socket.create_connection(("127.0.0.1", port), PATIENCE_S) as caller:
        caller.settimeout(0.2)
        with suppress(ConnectionError, TimeoutError):
            caller.sendall(said)
            while caller.recv(65_536):
                pass


@contextmanager
def half_connections(port: int, count: int) -> Iterator[list[socket.socket]]:
    """Connections whose callers begin to speak and stop in the middle of the first word."""
    with ExitStack() as stack:
        callers = []
        for _ in range(count):
            caller = stack.enter_context(socket.create_connection(("127.0.0.1", port), PATIENCE_S))
            caller.sendall(PREFACE[:7])
            callers.append(caller)
        yield callers
