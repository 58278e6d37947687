"""A service of a test's own on a Unix socket."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from common.bind import bind_unix
from common.rpc import new_server


@asynccontextmanager
async def serving_on(socket: Path, register: Callable[[Any], None]) -> AsyncIterator[None]:
    """Serves what `register` adds to the server while the block lasts."""
    server = new_server()
    register(server)
    bind_unix(server, socket)
    await server.start()
    try:
        yield
    finally:
        await server.stop(0)
