"""Serves the metrics of a program over plain HTTP on its event loop.

The server of prometheus_client gives every connection a thread and unlimited time; this one bounds both.
"""

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from http import HTTPStatus
from typing import Final

from common.addresses import bracketed
from common.errors import ExitCode, UserError

_log = logging.getLogger(__name__)

_DEADLINE_S: Final = 3.0
"""Seconds for a client to send its request and receive the response."""
_MAX_CONNECTIONS: Final = 4
"""Concurrent connections; further ones are closed."""
_MAX_REQUEST_BYTES: Final = 8192
_END_OF_REQUEST: Final = b"\r\n\r\n"
_TEXT_FORMAT: Final = "text/plain; version=0.0.4; charset=utf-8"


@asynccontextmanager
async def serving_metrics(text: Callable[[], bytes], host: str, port: int) -> AsyncIterator[int]:
    """Serves until the block ends.

    Args:
        text: returns the metrics in Prometheus' text format.
        host: an address of this machine.
        port: 0 for any free one.

    Yields:
        The bound port.

    Raises:
        UserError: the address can't be bound.
    """
    endpoint = _Endpoint(text)
    try:
        server = await asyncio.start_server(endpoint.serve, host, port, limit=_MAX_REQUEST_BYTES)
    except OSError as error:
        raise UserError(
            f"metrics can't be served at {bracketed(host)}:{port} ({error.strerror})",
            "Choose another metrics.host or metrics.port",
            exit_code=ExitCode.USAGE,
        ) from error
    bound = int(server.sockets[0].getsockname()[1])
    _log.info("metrics at http://%s:%d/metrics", bracketed(host), bound)
    async with server:
        yield bound


class _Endpoint:
    def __init__(self, text: Callable[[], bytes]) -> None:
        self._text = text
        self._connections = 0

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serves one connection: one request, one response."""
        self._connections += 1
        try:
            if self._connections <= _MAX_CONNECTIONS:
                async with asyncio.timeout(_DEADLINE_S):
                    writer.write(respond(await reader.readuntil(_END_OF_REQUEST), self._text))
                    await writer.drain()
        except (TimeoutError, OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError) as error:
            _log.debug("a metrics request got no response: %r", error)
            writer.transport.abort()
        finally:
            self._connections -= 1
            writer.close()
            with suppress(OSError):
                await writer.wait_closed()


def respond(request: bytes, text: Callable[[], bytes]) -> bytes:
    """Returns the complete response to a complete request (RFC 9112), valid or not."""
    method, _, rest = request.partition(b"\r\n")[0].partition(b" ")
    path = rest.partition(b" ")[0].partition(b"?")[0]
    if path != b"/metrics":
        return _http(HTTPStatus.NOT_FOUND, b"Only /metrics exists.\n")
    if method not in {b"GET", b"HEAD"}:
        return _http(HTTPStatus.METHOD_NOT_ALLOWED, b"Use GET.\n")
    body = text()
    return _http(HTTPStatus.OK, b"" if method == b"HEAD" else body, len(body))


def _http(status: HTTPStatus, body: bytes, length: int | None = None) -> bytes:
    head = (
        f"HTTP/1.1 {status.value} {status.phrase}\r\n"
        f"Content-Type: {_TEXT_FORMAT}\r\n"
        f"Content-Length: {len(body) if length is None else length}\r\n"
        "Connection: close\r\n\r\n"
    )
    return head.encode() + body
