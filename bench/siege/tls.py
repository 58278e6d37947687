"""TLS on plain sockets, many in one event loop: asyncio's own reserves 256 KiB for each connection."""

import asyncio
import socket
import ssl
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from typing import Any, Final, TypeVar

_OPEN_WITHIN_S: Final = 10.0
_READ_BYTES: Final = 65_536

T = TypeVar("T")


def careless_context() -> ssl.SSLContext:
    """Returns the TLS settings of a caller of gRPC who does not mind who answers."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.set_alpn_protocols(["h2"])
    return context


def client_hello(context: ssl.SSLContext) -> bytes:
    """Returns the first message of a handshake."""
    outgoing = ssl.MemoryBIO()
    tls = context.wrap_bio(ssl.MemoryBIO(), outgoing)
    try:
        tls.do_handshake()
    except ssl.SSLWantReadError:
        return outgoing.read()
    raise AssertionError("a handshake takes two")


@asynccontextmanager
async def tcp(source: str, target: tuple[str, int]) -> AsyncIterator[socket.socket]:
    """Connects from an address of this machine.

    Raises:
        OSError: there is no connection within 10 s.
    """
    with socket.socket() as caller:
        caller.setblocking(False)
        caller.bind((source, 0))
        async with asyncio.timeout(_OPEN_WITHIN_S):
            await asyncio.get_running_loop().sock_connect(caller, target)
        yield caller


class TlsConnection:
    """Reads and writes without blocking the event loop; raises OSError when the connection breaks."""

    def __init__(self, tls: ssl.SSLSocket) -> None:
        self._tls = tls

    @classmethod
    @asynccontextmanager
    async def open(
        cls, source: str, target: tuple[str, int], context: ssl.SSLContext
    ) -> AsyncIterator["TlsConnection"]:
        """Connects as `tcp` does; the handshake is done when the block begins."""
        async with tcp(source, target) as caller:
            with context.wrap_socket(caller, do_handshake_on_connect=False) as tls:
                connection = cls(tls)
                async with asyncio.timeout(_OPEN_WITHIN_S):
                    await connection._finish(tls.do_handshake)
                yield connection

    async def read(self) -> bytes:
        """Returns what has arrived; b"" at the end."""
        return await self._finish(lambda: self._tls.recv(_READ_BYTES))

    async def write(self, data: bytes) -> None:
        """Returns when all of it is on its way."""
        while data:
            sent = await self._finish(partial(self._tls.send, data))
            data = data[sent:]

    async def _finish(self, operation: Callable[[], T]) -> T:
        loop, descriptor = asyncio.get_running_loop(), self._tls.fileno()
        while True:
            try:
                return operation()
            except ssl.SSLWantReadError:
                await _once(loop.add_reader, loop.remove_reader, descriptor)
            except ssl.SSLWantWriteError:
                await _once(loop.add_writer, loop.remove_writer, descriptor)


async def _once(add: Callable[..., Any], remove: Callable[[int], Any], descriptor: int) -> None:
    """Waits until the descriptor is ready."""
    ready = asyncio.Event()
    add(descriptor, ready.set)
    try:
        await ready.wait()
    finally:
        remove(descriptor)
