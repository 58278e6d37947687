"""What attackers do to a gateway's port. They come back whenever they are cut off."""

import asyncio
import itertools
import struct
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, NamedTuple, NoReturn

from bench.siege.tls import TlsConnection, careless_context, client_hello, tcp
from tests.support.http2 import (
    ACK,
    BEGINNING,
    DATA,
    END_HEADERS,
    END_STREAM,
    GET_SYSTEM_STATUS,
    HEADERS,
    PING,
    RST_STREAM,
    SETTINGS,
    frame,
    literal,
)

REOPEN_S: Final = 1.0
"""Pause after a connection was refused or closed."""
FLOODER_REOPEN_S: Final = 0.1
DRIP_S: Final = 1.0
"""Between two bytes of a slow caller."""
_EMPTY_MESSAGE: Final = bytes(5)
"""A message of no bytes with gRPC's prefix: not compressed, length 0."""
_HEADER_BYTES: Final = 9
_SETTING: Final = struct.Struct(">HI")
_MAX_CONCURRENT_STREAMS: Final = 3
"""RFC 9113 6.5.2."""


@dataclass
class Counts:
    """What an attack came to.

    Attributes:
        tried: attempts to open a connection.
        opened: connections; with TLS, where the attacker goes that far.
        refused: calls that the gateway has answered.
    """

    tried: int = 0
    opened: int = 0
    refused: int = 0


class Crowd:
    """Attackers of one gateway.

    Args:
        target: address and port of the gateway.
    """

    def __init__(self, target: tuple[str, int]) -> None:
        self.counts = Counts()
        self._target = target
        self._context = careless_context()
        self._hello = client_hello(self._context)

    async def idle(self, source: str) -> NoReturn:
        """Holds a connection that is complete in every respect, but makes no call."""
        await self._persist(lambda: self._idle_once(source), REOPEN_S)

    async def drip(self, source: str) -> NoReturn:
        """Sends one byte of a TLS handshake each second."""
        await self._persist(lambda: self._drip_once(source), REOPEN_S)

    async def flood(self, source: str, token: str, method: bytes = GET_SYSTEM_STATUS) -> NoReturn:
        """Keeps as many calls of one method with this token open as a connection permits."""
        headers = method + literal(b"authorization", f"Bearer {token}".encode())
        await self._persist(lambda: self._flood_once(source, headers), FLOODER_REOPEN_S)

    async def _persist(self, attack: Callable[[], Awaitable[None]], pause_s: float) -> NoReturn:
        while True:
            self.counts.tried += 1
            with suppress(OSError):  # refused, reset or timed out: the gateway has defended itself
                await attack()
            await asyncio.sleep(pause_s)

    async def _idle_once(self, source: str) -> None:
        async with TlsConnection.open(source, self._target, self._context) as connection:
            self.counts.opened += 1
            await connection.write(BEGINNING)
            async for frames in _received(connection):
                await connection.write(_acknowledgements(frames))

    async def _drip_once(self, source: str) -> None:
        loop = asyncio.get_running_loop()
        async with tcp(source, self._target) as caller:
            self.counts.opened += 1
            for byte in self._hello:
                await loop.sock_sendall(caller, bytes((byte,)))
                await asyncio.sleep(DRIP_S)

    async def _flood_once(self, source: str, headers: bytes) -> None:
        streams = itertools.count(1, 2)  # a client's are odd (RFC 9113 5.1.1)

        def calls(count: int) -> bytes:
            return b"".join(_call(next(streams), headers) for _ in range(count))

        async with TlsConnection.open(source, self._target, self._context) as connection:
            self.counts.opened += 1
            await connection.write(BEGINNING)
            most, opened = 0, 0
            async for frames in _received(connection):
                most = next((each.max_streams for each in frames if each.max_streams is not None), most)
                ended = sum(each.ends_stream for each in frames)
                self.counts.refused += ended
                opened -= ended
                await connection.write(_acknowledgements(frames) + calls(most - opened))
                opened = most


class _Frame(NamedTuple):
    kind: int
    flags: int
    payload: bytes

    @property
    def max_streams(self) -> int | None:
        """SETTINGS_MAX_CONCURRENT_STREAMS; None where the frame does not say."""
        if self.kind != SETTINGS:
            return None
        settings = dict(_SETTING.iter_unpack(self.payload))
        return settings.get(_MAX_CONCURRENT_STREAMS)

    @property
    def ends_stream(self) -> bool:
        return self.kind == RST_STREAM or (self.kind == HEADERS and bool(self.flags & END_STREAM))


async def _received(connection: TlsConnection) -> AsyncIterator[list[_Frame]]:
    """Yields the whole frames of each read, until the gateway closes the connection."""
    buffer = bytearray()
    while data := await connection.read():
        buffer += data
        frames = []
        while len(buffer) >= _HEADER_BYTES:
            end = _HEADER_BYTES + int.from_bytes(buffer[:3], "big")
            if len(buffer) < end:
                break
            frames.append(_Frame(buffer[3], buffer[4], bytes(buffer[_HEADER_BYTES:end])))
            del buffer[:end]
        yield frames


def _acknowledgements(frames: list[_Frame]) -> bytes:
    """Returns the answers to settings and pings, without which the gateway would close the connection."""
    return b"".join(
        frame(each.kind, each.payload if each.kind == PING else b"", flags=ACK)
        for each in frames
        if each.kind in (SETTINGS, PING) and not each.flags & ACK
    )


def _call(stream: int, headers: bytes) -> bytes:
    return frame(HEADERS, headers, stream=stream, flags=END_HEADERS) + frame(
        DATA, _EMPTY_MESSAGE, stream=stream, flags=END_STREAM
    )
