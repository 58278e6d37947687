"""Files in the fleet's store over HTTP, in the form in which recordings are copied from a robot.

`console.client.exporting.Export` does the copying: cut connections made good, every byte verified. Here is
where its bytes come from. Nothing that comes is trusted: neither the URL, which a receiver signs and the hub
passes on, nor the content, whose SHA-256 is in the recording's receipt.

| what happens | what follows |
|---|---|
| the URL is not HTTPS (on this computer HTTP will do) | `GatewayFailed` |
| the store redirects | `Refused`; it is not followed |
| the store's certificate is of no known authority | `NotTrusted` |
| the URL has expired, or the store refuses it | a new one is requested, with the pauses of the export |
| the connection is cut or silent, or the store is overloaded | the same |
| the store does not have the file, or one of another size | `Refused` |
"""

import asyncio
import socket
import ssl
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from typing import Any, Final, Protocol
from urllib.parse import SplitResult, urlsplit

from console.client.errors import GatewayFailed, NotTrusted, Overloaded, Refused, Unreachable
from console.client.file_stream import SILENT_S, PullStream, chunk_of
from console.client.mapping.methods import Method
from console.client.results import ExportHeader, RecordingFile
from fleet.servers import THIS_MACHINE
from omniseer.gateway.v1.recording_pb2 import ExportRecordingRequest

_CHUNK: Final = 256 * 1024
_CONNECTED_WITHIN_S: Final = 10.0
_LONGEST_URL: Final = 8192
_BUSY: Final = frozenset({HTTPStatus.TOO_MANY_REQUESTS, HTTPStatus.SERVICE_UNAVAILABLE})
_WAIT: Final = "The store is reached at the address that the receivers have; docs/uploads.md"


class Urls(Protocol):
    """Where the files are."""

    async def url(self, name: str) -> str:
        """Returns the URL of a file, or raises a `GatewayError`."""

    def forget(self, name: str) -> None:
        """Makes the next call request a new URL."""


class StoreTransport:
    """What an export reads from the store.

    Args:
        files: Of the recording, by name.
        urls: Where they are.
        tls: For the store's certificate.
    """

    def __init__(self, files: Mapping[str, RecordingFile], urls: Urls, tls: ssl.SSLContext) -> None:
        self._files, self._urls, self._tls = files, urls, tls

    def pull(self, _method: Method[Any], request: bytes) -> PullStream:
        """Returns the bytes of a file from an offset on, as ExportRecording would send them."""
        wanted = ExportRecordingRequest.FromString(request)
        return StoreStream(self._files[wanted.file], wanted.offset, self._urls, self._tls)

    async def sleep(self, seconds: float) -> None:
        """Sleeps."""
        await asyncio.sleep(seconds)


class StoreStream:
    """The rest of one file, over one connection.

    Args:
        file: As the recording lists it.
        offset: Where to begin.
        urls: Where it is.
        tls: For the store's certificate.
    """

    def __init__(self, file: RecordingFile, offset: int, urls: Urls, tls: ssl.SSLContext) -> None:
        self._file, self._offset, self._urls, self._tls = file, offset, urls, tls
        self._connection: _Connection | None = None
        self._response: HTTPResponse | None = None

    async def read(self, within_s: float | None = None) -> Any:
        """Returns the header, and then chunk after chunk; raises a `GatewayError`."""
        if self._connection is None or self._response is None:
            self._connection = _Connection(usable(await self._urls.url(self._file.name)), self._tls)
            self._response = await self._connection.get(self._offset, within_s or SILENT_S)
            self.check(self._response)
            return ExportHeader(size=self._file.size, sha256=self._file.sha256)
        data: bytes = await self._connection.call(self._response.read1, _CHUNK)
        if not data:
            raise Unreachable(f"the store ended {self._file.name} too early", _WAIT)
        chunk = chunk_of(data, self._offset)
        self._offset += len(data)
        return chunk

    def cancel(self) -> None:
        """Closes the connection, also while a thread reads."""
        if self._connection:
            self._connection.end()

    def check(self, response: HTTPResponse) -> None:
        """Checks the head of an answer.

        Raises:
            GatewayError: It does not begin what was requested.
        """
        status, name = response.status, self._file.name
        if status == (HTTPStatus.PARTIAL_CONTENT if self._offset else HTTPStatus.OK):
            if response.length == self._file.size - self._offset:
                return
            raise Refused(f"the store has {name} with another size than the recording lists")
        if status in _BUSY:
            raise Overloaded(f"the store is busy ({status})")
        if status == HTTPStatus.FORBIDDEN or status >= HTTPStatus.INTERNAL_SERVER_ERROR:
            self._urls.forget(name)
            raise Unreachable(f"the store refuses {name} ({status})", _WAIT)
        if status == HTTPStatus.NOT_FOUND:
            raise Refused(f"the store does not have {name} any more", "Ask who administers the store")
        raise Refused(f"the store answers {name} with status {status}", _WAIT)


def usable(url: str) -> SplitResult:
    """Returns the parts of a URL from a receiver.

    Raises:
        GatewayFailed: It is none of a store: without TLS, or with a password in it.
    """
    with suppress(ValueError):  # It has no port, or half of an IPv6 address.
        parts = urlsplit(url)
        secure = parts.scheme == "https" or (parts.scheme == "http" and parts.hostname in THIS_MACHINE)
        plain = url.isascii() and url.isprintable() and " " not in url and len(url) <= _LONGEST_URL
        if secure and plain and parts.hostname and "@" not in parts.netloc and parts.port != 0:
            return parts
    raise GatewayFailed(
        "a receiver names a URL that is none of a store with TLS",
        "Give the receivers' store.public_endpoint an address with https (docs/uploads.md)",
    )


async def read_whole(url: SplitResult, tls: ssl.SSLContext, most: int) -> bytes:
    """Returns a small object of the store.

    Raises:
        GatewayError: It can't be read, or has more bytes than `most`.
    """
    connection = _Connection(url, tls)
    try:
        response = await connection.get(0, SILENT_S)
        content: bytes = await connection.call(response.read, most + 1)
    finally:
        connection.end()
    if response.status != HTTPStatus.OK or len(content) > most:
        raise Refused(f"the store does not have the recording's list of files (status {response.status})")
    return content


class _Connection:
    """One connection. Threads use it, one at a time; the loop may end it at any moment.

    Args:
        url: Of the object.
        tls: For the store's certificate.
    """

    def __init__(self, url: SplitResult, tls: ssl.SSLContext) -> None:
        self._url = url
        host, limit_s = url.hostname or "", _CONNECTED_WITHIN_S
        self._http = (
            HTTPSConnection(host, url.port, timeout=limit_s, context=tls)
            if url.scheme == "https"
            else HTTPConnection(host, url.port, timeout=limit_s)
        )
        self._socket: socket.socket | None = None
        self._in_use = threading.Lock()
        self._ended = False

    async def get(self, offset: int, silent_s: float) -> HTTPResponse:
        """Returns the answer to a GET from an offset on; raises a `GatewayError`."""
        response: HTTPResponse = await self.call(self._get, offset, silent_s)
        return response

    async def call(self, blocking: Callable[..., Any], *arguments: Any) -> Any:
        """Returns what a blocking call returns, from a thread; raises a `GatewayError`."""
        return await _in_thread(self._used, blocking, *arguments)

    def end(self) -> None:
        """Ends it, and what a thread waits for."""
        self._ended = True
        if self._socket:
            with suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)
        self._close_if_ended()

    def _get(self, offset: int, silent_s: float) -> HTTPResponse:
        self._http.connect()
        # The library forgets it where the store closes the connection after its answer.
        self._socket = self._http.sock
        self._socket.settimeout(silent_s)
        # The Host header is part of the signature: http.client sends the one of the URL.
        path = f"{self._url.path}?{self._url.query}" if self._url.query else self._url.path
        self._http.request("GET", path or "/", headers={"Range": f"bytes={offset}-"} if offset else {})
        return self._http.getresponse()

    def _used(self, blocking: Callable[..., Any], *arguments: Any) -> Any:
        try:
            with self._in_use:
                return blocking(*arguments)
        finally:
            self._close_if_ended()

    def _close_if_ended(self) -> None:
        """Closes it, unless a thread uses it: then that does so.

        A response that is closed under its reader would be waited for.
        """
        if self._ended and self._in_use.acquire(blocking=False):
            try:
                self._http.close()
            finally:
                self._in_use.release()


async def _in_thread(call: Callable[..., Any], *arguments: Any) -> Any:
    """Returns what a blocking call of the store returns; its errors are those of an export."""
    try:
        return await asyncio.to_thread(call, *arguments)
    except ssl.SSLCertVerificationError as error:
        raise NotTrusted(
            f"the store's certificate is not trusted: {error.verify_message}",
            "Name the authority that has signed it: --store-ca FILE",
        ) from error
    except (OSError, HTTPException, ValueError) as error:
        text = str(error) or type(error).__name__
        raise Unreachable(f"the store does not answer: {text}", _WAIT) from error
