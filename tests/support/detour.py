"""A way to a server from another address of this machine, which no option of a gRPC client chooses."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

_HERE = "127.0.0.1"


@asynccontextmanager
async def detour(address: str, port: int, host: str = _HERE) -> AsyncIterator[int]:
    """A port of `host` whose connections go on to `port` there, from another address of this machine.

    A caller that hangs up before it is connected ends the attempt, as if it had made it from there itself.
    """
    ways: list[_Way] = []

    def new_way() -> _Way:
        ways.append(_Way(address, (host, port)))
        return ways[-1]

    async with await asyncio.get_running_loop().create_server(new_way, host, 0) as server:
        try:
            yield server.sockets[0].getsockname()[1]
        finally:
            server.close()
            await asyncio.gather(*(way.end() for way in ways), return_exceptions=True)


class _Way(asyncio.Protocol):
    """The near end of one connection: passes on what its caller says, once the far end is connected."""

    def __init__(self, address: str, server: tuple[str, int]) -> None:
        self._address, self._server = address, server
        self._said: list[bytes] = []
        self._far: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.near = transport
        self._connecting = asyncio.get_running_loop().create_task(self._connect())

    async def _connect(self) -> None:
        try:
            await asyncio.get_running_loop().create_connection(
                lambda: _FarEnd(self), *self._server, local_addr=(self._address, 0)
            )
        except OSError:
            self.near.abort()

    def connected(self, far: asyncio.Transport) -> None:
        """The server has accepted."""
        self._far = far
        far.writelines(self._said)

    def data_received(self, data: bytes) -> None:
        if self._far:
            self._far.write(data)
        else:
            self._said.append(data)

    def connection_lost(self, _error: Exception | None) -> None:
        self._connecting.cancel()
        if self._far:
            self._far.close()

    async def end(self) -> None:
        """Ends both connections, or the attempt."""
        self.near.abort()
        self._connecting.cancel()
        await self._connecting


class _FarEnd(asyncio.Protocol):
    def __init__(self, way: _Way) -> None:
        self._way = way

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._way.connected(transport)

    def data_received(self, data: bytes) -> None:
        self._way.near.write(data)

    def connection_lost(self, _error: Exception | None) -> None:
        self._way.near.close()
