"""What no client of ours would send: broken HTTP/2, too much of everything, and half connections."""

import random
import socket
import struct
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

PATIENCE_S = 10
_PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
_DATA, _HEADERS, _PRIORITY, _RST_STREAM, _SETTINGS, _PING, _WINDOW_UPDATE, _CONTINUATION = (
    0,
    1,
    2,
    3,
    4,
    6,
    8,
    9,
)
_END_HEADERS = 4
_LONGEST_FRAME = 16_384


def _frame(
    kind: int, payload: bytes = b"", *, stream: int = 0, flags: int = 0, length: int | None = None
) -> bytes:
    """One HTTP/2 frame, with a length that may lie."""
    size = len(payload) if length is None else length
    return size.to_bytes(3, "big") + bytes((kind, flags)) + stream.to_bytes(4, "big") + payload


def _literal(name: bytes, value: bytes) -> bytes:
    """One header, spelled out: HPACK without any table."""
    return b"\x00" + _length(name) + name + _length(value) + value


def _length(text: bytes) -> bytes:
    size = len(text)
    if size < 127:
        return bytes((size,))
    size, coded = size - 127, bytearray((127,))
    while size >= 128:
        coded.append(size % 128 + 128)
        size //= 128
    return bytes((*coded, size))


_BEGINNING = _PREFACE + _frame(_SETTINGS)
_CALL = b"".join(
    _literal(name, value)
    for name, value in (
        (b":method", b"POST"),
        (b":scheme", b"http"),
        (b":path", b"/omniseer.gateway.v1.RobotGateway/GetSystemStatus"),
        (b":authority", b"robot"),
        (b"te", b"trailers"),
        (b"content-type", b"application/grpc"),
    )
)


def _continued(headers: bytes) -> bytes:
    """Headers of any size, in frames of the greatest size, without an end."""
    parts = [headers[at : at + _LONGEST_FRAME] for at in range(0, len(headers), _LONGEST_FRAME)]
    return _frame(_HEADERS, _CALL, stream=1) + b"".join(
        _frame(_CONTINUATION, each, stream=1) for each in parts
    )


def _taken_back(stream: int) -> bytes:
    """A call, and its end before anybody could answer."""
    return _frame(_HEADERS, _CALL, stream=stream, flags=_END_HEADERS) + _frame(
        _RST_STREAM, bytes(4), stream=stream
    )


CONVERSATIONS = {
    "noise": random.Random(7).randbytes(20_000),
    "an HTTP/1 request": b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n",
    "a TLS hello": bytes.fromhex("16030100a5010000a10303") + bytes(200),
    "noise after a good beginning": _BEGINNING + random.Random(8).randbytes(20_000),
    "a frame that claims 16 MiB": _BEGINNING + _frame(_DATA, b"x", stream=1, length=0xFFFFFF),
    "settings of a wrong size": _PREFACE + _frame(_SETTINGS, b"12345"),
    "a window of nothing": _BEGINNING + _frame(_WINDOW_UPDATE, bytes(4)),
    "windows that overflow": _BEGINNING + _frame(_WINDOW_UPDATE, struct.pack(">I", 2**31 - 1)) * 3,
    "data of no stream": _BEGINNING + _frame(_DATA, b"x" * 100),
    "headers of an even stream": _BEGINNING + _frame(_HEADERS, _CALL, stream=2, flags=_END_HEADERS),
    "many headers without an end": _BEGINNING + _continued(_literal(b"x", b"y" * 1000) * 4000),
    "a header of 4 MiB": _BEGINNING + _continued(_literal(b"big", b"z" * 4_000_000)),
    "a place of a table that is not there": _BEGINNING
    + _frame(_HEADERS, b"\xff\xff\xff\x7f", stream=1, flags=_END_HEADERS),
    "five thousand settings": _PREFACE + _frame(_SETTINGS) * 5000,
    "five thousand pings": _BEGINNING + _frame(_PING, bytes(8)) * 5000,
    "ten thousand calls, each taken back at once": _BEGINNING
    + b"".join(_taken_back(stream) for stream in range(1, 20_000, 2)),
    "a stream that depends on itself": _BEGINNING
    + _frame(_PRIORITY, struct.pack(">IB", 1, 255), stream=1) * 100,
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
            caller.sendall(_PREFACE[:7])
            callers.append(caller)
        yield callers
