"""A relay for TCP connections to a port of this machine: they can be cut, frozen, delayed, and refused."""

import asyncio
from types import TracebackType
from typing import Self


class Relay:
    """Passes bytes on both ways while its block runs.

    Args:
        to_port: of the server.

    Attributes:
        port: where clients connect.
        open: whether connections are accepted.
        frozen: whether bytes are lost, on connections that stay: as where the other end has vanished.
        through: set while bytes pass; they wait while it is not: as where TCP sends them again and again.
        to_clients: bytes that were passed on to clients.
    """

    def __init__(self, to_port: int) -> None:
        self._to_port = to_port
        self.port = 0
        self.open = True
        self.frozen = False
        self.through = asyncio.Event()
        self.through.set()
        self.to_clients = 0
        self._writers: set[asyncio.StreamWriter] = set()
        self._tasks: set[asyncio.Task[None]] = set()

    async def __aenter__(self) -> Self:
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.close()
        self.cut()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def cut(self) -> None:
        """Resets every connection."""
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if not self.open:
            writer.transport.abort()
            return
        there, back = await asyncio.open_connection("127.0.0.1", self._to_port)
        self._writers |= {writer, back}
        for source, sink in ((reader, back), (there, writer)):
            task = asyncio.create_task(self._pass_on(source, sink, to_client=sink is writer))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _pass_on(
        self, source: asyncio.StreamReader, sink: asyncio.StreamWriter, *, to_client: bool
    ) -> None:
        try:
            while data := await source.read(65536):
                if self.frozen:
                    continue
                await self.through.wait()
                sink.write(data)
                await sink.drain()
                if to_client:
                    self.to_clients += len(data)
        except ConnectionError:
            pass
        if not self.frozen:  # Otherwise the end is lost, too.
            sink.transport.abort()
