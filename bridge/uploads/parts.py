"""Sends parts to the store by HTTP; the one home of aiohttp.

The URLs come from the hub, which may be hostile: nothing is sent to another host than those of the robot's
enrolment, nothing without TLS, and no redirect is followed. So a URL can't make the robot reach into its own
network. What the store answers is read up to a bound, and nothing of it is trusted: only a receipt counts.

| what happens | what follows |
|---|---|
| 403 | `ExpiredError`: the URL is renewed, once for each part |
| 404 | `LostError`: the store does not know the multipart upload any more; the file is begun again |
| 507, or a code that says so | the store has no room: `CutError`, as for all that follows |
| another status, or a redirect | with the status and the store's code |
| the way to the store leads through an interface that is not allowed | no connection is made |
| no connection within 10 s, no progress for 60 s, cut | with what the connection reports |
"""

import asyncio
import errno
import re
import socket
import ssl
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from typing import TYPE_CHECKING, Final, Self
from urllib.parse import SplitResult, unquote, urlsplit

import aiohttp
from yarl import URL

from bridge.config import UploadSettings
from bridge.uploads.gates import wrong_interface
from bridge.uploads.problems import CutError
from bridge.uploads.route import interface_of
from common.errors import UserError
from common.pace import Pace

if TYPE_CHECKING:
    from aiohappyeyeballs import AddrInfoType

_CONNECT_S: Final = 10.0
_SILENT_S: Final = 60.0
"""Longest time without a byte that the connection takes, or without an answer."""
_WHOLE_S: Final = 900.0
"""Of one part: as long as its URL is valid."""
_LONGEST_URL: Final = 4096
_LONGEST_ETAG: Final = 128
_ANSWER_BYTES: Final = 4096
_CODE: Final = re.compile(rb"<Code>([A-Za-z]{1,64})</Code>")
_NO_ROOM: Final = frozenset({"QuotaExceeded", "XMinioStorageFull", "InsufficientStorage", "StorageFull"})
_INSUFFICIENT_STORAGE: Final = 507
"""RFC 4918 11.5."""


class ExpiredError(Exception):
    """The store does not accept the URL."""


class LostError(Exception):
    """The store does not know the multipart upload."""


class PartSender:
    """Connections to the store. Used in an `async with` block.

    Args:
        settings: Where recordings may be sent, and how fast.
    """

    def __init__(self, settings: UploadSettings) -> None:
        self._settings = settings
        self._pace = Pace(settings.max_bytes_per_s)
        self._session = aiohttp.ClientSession(
            connector=aiohttp.TCPConnector(ssl=_tls(settings), limit=2, socket_factory=self._socket),
            timeout=aiohttp.ClientTimeout(total=_WHOLE_S, sock_connect=_CONNECT_S, sock_read=_SILENT_S),
            cookie_jar=aiohttp.DummyCookieJar(),
            # Neither proxies nor passwords from the environment: the hosts above are all there is.
            trust_env=False,
            auto_decompress=False,
        )
        self.host = ""
        """Of the store's, HOST or HOST:PORT: where the last part went; empty before the first."""
        self.sent_bytes = 0
        """Handed to connections since the start, those that were sent twice included."""

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._session.close()

    async def put(self, url: str, size: int, body: AsyncIterator[bytes]) -> str:
        """Sends a part and returns its entity tag.

        Args:
            url: From the hub.
            size: Of the part, in bytes.
            body: Yields as many.

        Raises:
            ExpiredError, LostError, CutError: See the table.
        """
        checked = checked_url(url, self._settings)
        self.host = checked.authority
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(_SILENT_S) as silence:

                def moved() -> None:
                    silence.reschedule(loop.time() + _SILENT_S)

                async with self._session.put(
                    checked,
                    data=self._paced(body, moved),
                    headers={"Content-Length": str(size), "Content-Type": "application/octet-stream"},
                    allow_redirects=False,
                ) as answer:
                    return await _etag(answer)
        except (aiohttp.ClientError, OSError, TimeoutError) as error:
            text = _text(error) or "no progress for a minute"
            raise CutError(f"the store at {checked.host} can't be reached: {text[:200]}") from error

    def _socket(self, address: "AddrInfoType") -> socket.socket:
        """Returns the socket for a connection to an address, the very one that is connected to.

        Raises:
            OSError: There is no route to it, or it leads through an interface that is not allowed.
        """
        family, kind, protocol, _, where = address
        if self._settings.interfaces and (
            why := wrong_interface(self._settings, interface_of(str(where[0])))
        ):
            raise OSError(errno.EHOSTUNREACH, why)
        return socket.socket(family, kind, protocol)

    async def _paced(self, body: AsyncIterator[bytes], moved: Callable[[], None]) -> AsyncGenerator[bytes]:
        loop = asyncio.get_running_loop()
        async for data in body:
            if (delay_s := self._pace.delay_s(loop.time(), len(data))) > 0:
                moved()
                await asyncio.sleep(delay_s)
            yield data
            # The connection has taken it.
            self.sent_bytes += len(data)
            moved()


def checked_url(url: str, settings: UploadSettings) -> URL:
    """Returns the URL of a part, if recordings may be sent there.

    Raises:
        CutError: They may not.
    """
    try:
        parts, whole = urlsplit(url), URL(url, encoded=True)
        host = _host_of(parts)
    except ValueError as error:
        raise CutError("the hub returned a URL that is none; nothing was sent") from error
    scheme = "http" if settings.insecure_store else "https"
    plain = url.isascii() and url.isprintable() and len(url) <= _LONGEST_URL and " " not in url
    # A store, or a proxy before it, may take them for a step up.
    plain = plain and not {".", ".."}.intersection(unquote(parts.path).replace("\\", "/").split("/"))
    if not plain or parts.scheme != scheme or parts.username is not None or parts.fragment:
        raise CutError(f"the hub returned a URL that is not a plain {scheme} one; nothing was sent")
    if not settings.permits(host, parts.path):
        where = "the path of which" if host in settings.hosts else "which"
        raise CutError(
            f"the hub returned a URL of {host[:80] or 'no host'}, {where} is not in uploads.store_hosts; "
            "nothing was sent"
        )
    return whole


def _host_of(parts: SplitResult) -> str:
    """Returns HOST, or HOST:PORT where the port is named."""
    host = parts.hostname or ""
    return host if parts.port is None else f"{host}:{parts.port}"


def _text(error: Exception) -> str:
    """Returns what an error says; of several addresses, what that of each said."""
    if isinstance(error, aiohttp.ClientConnectorError) and error.os_error.strerror is None:
        return str(error.os_error)
    return str(error)


async def _etag(answer: aiohttp.ClientResponse) -> str:
    """Returns the entity tag that the store has given to a part."""
    if answer.status == 200:
        etag = answer.headers.get("ETag", "")
        if not 0 < len(etag) <= _LONGEST_ETAG or not etag.isascii() or not etag.isprintable():
            raise CutError("the store took a part and returned no entity tag")
        return etag
    found = _CODE.search(await answer.content.read(_ANSWER_BYTES))
    code = found[1].decode() if found else ""
    if answer.status == _INSUFFICIENT_STORAGE or code in _NO_ROOM:
        raise CutError("the fleet's store has no room")
    if answer.status == 403:
        raise ExpiredError(code)
    if answer.status == 404:
        raise LostError(code)
    raise CutError(f"the store answered a part with {answer.status} {code}".rstrip())


def _tls(settings: UploadSettings) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=settings.ca)
    except (OSError, ssl.SSLError) as error:
        raise UserError(
            f"the store's certificate authority {settings.ca} can't be read: {error}",
            "Copy it again from the robot's enrolment, or correct uploads.ca",
        ) from error
