"""The NATS library's client with bounds, and with our errors: the only importer of the library.

It never reconnects. What a hostile server may cost is bounded: the size of a message with its headers and
subjects, of what waits to be read or sent, and of the list of servers, to which it can add none. What is not
taken of its messages is counted.
"""

import asyncio
import base64
import ssl
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, Protocol
from urllib.parse import ParseResult

from nats import errors as nats_errors
from nats.aio.client import Client
from nats.aio.msg import Msg
from nats.aio.subscription import Subscription
from nats.aio.transport import TcpTransport
from nats.nuid import NUID
from nats.protocol.parser import AWAITING_CONTROL_LINE, PERMISSIONS_ERR, Parser

from common.deadline import within
from fleet.errors import HubError, HubReason, RefusedError, UnreachableError
from fleet.identity import Credentials
from fleet.incoming import read_headers, read_place, read_reply, read_subject
from fleet.names import LARGEST_MESSAGE
from fleet.replies import MAX_WAITING, MAX_WAITING_MESSAGES, Message, NotTaken

CONNECT_TIMEOUT_S: Final = 5.0
"""For one server: name resolution, TCP, TLS and authentication."""
_PING_INTERVAL_S: Final = 4
_PINGS_WITHOUT_ANSWER: Final = 2
"""A connection without an answer for (2 + 1) x 4 s is lost: half-open TCP is found within 15 s."""
_MAX_MESSAGE: Final = 4 * 1024 * 1024
"""Longest message that is read, in bytes; the hub's max_payload is 1 MiB."""
_MAX_CONTROL_LINE: Final = 64 * 1024
"""Longest line of the protocol, in bytes; the longest of an honest server is INFO, of some KiB."""
_REFUSALS: Final = ("authorization violation", "authentication", "credentials", "account", "jwt")

Callback = Callable[[Message], Awaitable[None]]
"""Takes a message of a subscription."""


class Listener(Protocol):
    """What a client notifies."""

    async def on_reply(self, message: Message) -> None:
        """Takes a message of the inbox."""

    def on_error(self, text: str) -> None:
        """Takes an error that the library reports beside the calls, in lower case."""

    def on_lost(self, reason: HubError) -> None:
        """Takes the end of the connection; only the first one counts."""


class _BoundedParser(Parser):
    """Ends a connection whose server announces a message beyond any size, or says what can't be read.

    At an error that it does not know, the library's loop ends, and the connection is never read again.
    """

    async def parse(self, data: bytes = b"") -> None:
        try:
            await super().parse(data)
        except Exception as error:
            raise nats_errors.ProtocolError from error
        if max(len(self.buf), self.needed) > _MAX_MESSAGE:
            raise nats_errors.ProtocolError
        if self.state == AWAITING_CONTROL_LINE and len(self.buf) > _MAX_CONTROL_LINE:
            raise nats_errors.ProtocolError


class _Transport(TcpTransport):
    """Sends CONNECT and the PING after it in one piece.

    A server that refuses the credentials answers CONNECT and closes. A PING that is sent after that breaks
    the connection before the answer is read, and a refusal would look like a network failure.
    """

    _held = b""
    _tcp: asyncio.WriteTransport | None = None

    def __bool__(self) -> bool:
        # The client makes a transport of its own in the place of a false one.
        return True

    async def connect(self, uri: ParseResult, buffer_size: int, connect_timeout: int) -> None:
        await super().connect(uri, buffer_size, connect_timeout)
        self._tcp = self._writer().transport

    def write(self, payload: bytes) -> None:
        if payload.startswith(b"CONNECT "):
            self._held = payload
            return
        self._writer().write(self._held + payload)
        self._held = b""

    async def connect_tls(
        self,
        uri: str | ParseResult,
        ssl_context: ssl.SSLContext,
        buffer_size: int,  # noqa: ARG002  # the library's signature
        connect_timeout: int,
    ) -> None:
        # As the streams of asyncio do it; by hand, each end of a connection would be a warning in the log.
        host = uri if isinstance(uri, str) else uri.hostname
        try:
            async with asyncio.timeout(connect_timeout):
                await self._writer().start_tls(ssl_context, server_hostname=host)
        except BaseException:
            # asyncio does not report the end of a connection that ends within the handshake: `wait_closed`
            # would wait for it until its time-out.
            self.abort()
            self._io_writer = None
            raise

    def abort(self) -> None:
        """Closes the connection at once: a server that reads nothing would keep it open."""
        # TLS above it can't be ended like that once it has been closed from both ends.
        if self._tcp is not None:
            self._tcp.abort()

    def _writer(self) -> asyncio.StreamWriter:
        if self._io_writer is None:
            raise ConnectionError("there is no connection")
        return self._io_writer


class _BoundedClient(Client):
    """The library's client, with bounds on what a server can make it do. What it overrides are its hooks.

    Each other name here could be one of a later release: tests/unit/fleet/test_nats_client.py compares them.

    Args:
        not_taken: counts what is not taken of its messages.
    """

    def __init__(self, not_taken: NotTaken) -> None:
        super().__init__()
        self._ps = _BoundedParser(self)
        self._own_transport = _Transport()  # type: ignore[no-untyped-call]  # the library's
        self._transport = self._own_transport
        self._not_taken = not_taken
        self.farewell = ""
        """What the server said before it closed the connection; the library keeps the last error only."""

    @property
    def is_encrypted(self) -> bool:
        """Whether TLS is in use; known before anything is said to the server."""
        return bool(self._server_info.get("tls_required"))

    def abort(self) -> None:
        """Closes the connection without what waits to be sent."""
        self._pending.clear()
        self._pending_data_size = 0
        self._own_transport.abort()

    async def _process_op_err(self, e: Exception) -> None:
        # What waits to be sent is lost with the connection. The library would try to send it when it closes,
        # fail at that, and end half-way: without a word, with its tasks and its socket left behind.
        self.abort()
        await super()._process_op_err(e)

    async def _flush_pending(self, force_flush: bool = False) -> Any:
        # A server that sends pings and reads none of their answers: the library would wait for a place in
        # this queue for ever, and its own pings, which find a silent server, with it.
        if self.is_connected and self._flush_queue is not None and self._flush_queue.full():
            await self._process_op_err(nats_errors.StaleConnectionError())
        return await super()._flush_pending(force_flush)

    async def _process_headers(self, headers: bytes | None) -> dict[str, str] | None:
        if not headers:
            return None
        found = read_headers(headers)
        if found is None:
            self._not_taken.unreadable += 1
        # Also where the sender's own are unreadable: without its place, a stored message could not be passed.
        return (found or {}) | read_place(headers)

    def _build_message(
        self, sid: int, subject: bytes, reply: bytes, data: bytes, headers: dict[str, str] | None
    ) -> Msg:
        (to, subject_readable), (reply_to, reply_readable) = read_subject(subject), read_reply(reply)
        self._not_taken.unreadable += (not subject_readable) + (not reply_readable)
        return Msg(_client=self, subject=to, reply=reply_to, data=data, headers=headers, _sid=sid)

    async def _process_pong(self) -> None:
        # A flush that timed out has left its cancelled future behind, and the library would complete it.
        if self._pongs and self._pongs[0].done():
            self._pongs[0] = asyncio.get_running_loop().create_future()
        await super()._process_pong()

    async def _send_ping(self, future: asyncio.Future[bool] | None = None) -> None:
        # The library writes PING past what still waits for its flusher; to a flush the PONG is to prove that
        # the server has that, too. A ping without a future only looks for a silent server: it does not wait
        # until that has taken the rest.
        if future is not None:
            await self._flush_pending(force_flush=True)
        await super()._send_ping(future)

    async def _process_err(self, err_msg: str) -> None:
        if PERMISSIONS_ERR not in err_msg:
            self.farewell = self.farewell or err_msg.strip("'")
        await super()._process_err(err_msg)

    async def _process_info(self, info: dict[str, Any], initial_connection: bool = False) -> None:
        # Servers are those of the configuration, and TLS names with them.
        info.pop("connect_urls", None)
        await super()._process_info(info, initial_connection)


class NatsClient:
    """A client of one server.

    Args:
        server: as "tls://host:4222".
        not_taken: counts what is not taken of its messages.
        listener: is notified.
    """

    def __init__(self, server: str, not_taken: NotTaken, listener: Listener) -> None:
        self._client = _BoundedClient(not_taken)
        self._address = server
        self._not_taken = not_taken
        self._listener = listener
        self._reported: Exception | None = None
        """The newest error that the library reported beside the calls."""

    @property
    def is_connected(self) -> bool:
        """Whether the connection stands, as far as is known."""
        return self._client.is_connected

    async def open(self, inbox: str, *, name: str, credentials: Path | None, ca: Path | None) -> None:
        """Connects, and listens to the subjects of an inbox.

        Args:
            inbox: prefix of the subjects.
            name: shown in the servers' lists of connections.
            credentials: a .creds file.
            ca: authority of the server's certificate.

        Raises:
            UnreachableError: the server can't be reached, or is not who it has to be.
            RefusedError: it does not accept the credentials.
        """
        options = self._authentication(credentials, ca)
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT_S):
                await self._client.connect(
                    servers=[self._address],
                    name=name,
                    error_cb=self._on_error,
                    closed_cb=self._on_closed,
                    allow_reconnect=False,
                    # How often the library tries again in here; 0 would be for ever.
                    max_reconnect_attempts=1,
                    reconnect_time_wait=0,
                    connect_timeout=CONNECT_TIMEOUT_S,  # type: ignore[arg-type]  # any number of seconds
                    ping_interval=_PING_INTERVAL_S,
                    max_outstanding_pings=_PINGS_WITHOUT_ANSWER,
                    flush_timeout=CONNECT_TIMEOUT_S,
                    **options,
                )
                _repeat_cancellation()
                self._check(encrypted=ca is not None)
                await self._subscribe(f"{inbox}.*", self._listener.on_reply)
                await self._flush()
        except Exception as error:
            # The library trips over what is no server of NATS in many ways: a greeting may be anything.
            await self.close()
            raise _connect_error(self._address, self._reported or error) from error
        except asyncio.CancelledError:
            # A silent server would be waited for until the time-out of the end of TLS.
            self._client.abort()
            await self.close()
            raise

    async def close(self) -> None:
        """Closes the connection, and leaves no socket behind."""
        try:
            with suppress(TimeoutError, OSError, nats_errors.Error):
                await within(CONNECT_TIMEOUT_S, self._client.close())
        finally:
            # The socket of a server that does not take what is left would stay open.
            self._client.abort()

    async def publish(self, subject: str, payload: bytes, reply: str, headers: dict[str, str] | None) -> None:
        """Hands a message to the connection.

        Raises:
            UnreachableError, HubError: it can't be sent.
        """
        if not self.is_connected:
            raise UnreachableError("the connection to the hub is lost")
        # The library knows the limit of the server alone, which is a higher one.
        if len(payload) > LARGEST_MESSAGE:
            raise _too_large(payload)
        try:
            await self._client.publish(subject, payload, reply, headers)
        except nats_errors.MaxPayloadError as error:
            raise _too_large(payload) from error
        except (nats_errors.BadSubjectError, nats_errors.BadHeaderError) as error:
            raise HubError(HubReason.INVALID, f"'{subject[:100]}' is no subject") from error
        except (OSError, nats_errors.Error) as error:
            raise _lost(error) from error

    async def subscribe(self, subject: str, callback: Callback, queue: str = "") -> Subscription:
        """Subscribes to a subject; what comes too fast is dropped.

        Raises:
            UnreachableError: the connection is lost.
        """
        with _raising_lost():
            return await self._subscribe(subject, callback, queue)

    async def flush(self) -> None:
        """Returns when the server has taken all that was sent before.

        Raises:
            UnreachableError: the connection is lost.
        """
        with _raising_lost():
            await self._flush()

    def new_id(self) -> str:
        """Returns an ID that no other client has."""
        return NUID().next().decode()

    def _check(self, *, encrypted: bool) -> None:
        """Checks that the connection is one as required.

        Raises:
            UnreachableError: it is not.
        """
        if not self.is_connected:
            raise UnreachableError("it does not speak as a NATS server does")
        if encrypted and not self._client.is_encrypted:
            raise UnreachableError("it does not offer TLS")
        size: Any = self._client.max_payload  # As the server has it.
        if not isinstance(size, int):
            raise UnreachableError("its greeting names no size of messages")

    def _authentication(self, credentials: Path | None, ca: Path | None) -> dict[str, Any]:
        options: dict[str, Any] = {}
        if ca is not None:
            options["tls"] = _tls_context(ca)
        if credentials is not None:
            creds = Credentials.read(credentials)
            options["user_jwt_cb"] = creds.jwt.encode
            options["signature_cb"] = lambda nonce: self._signed(creds, nonce, encrypted=ca is not None)
        return options

    def _signed(self, creds: Credentials, nonce: str, *, encrypted: bool) -> bytes:
        """Signs the server's challenge.

        Raises:
            UnreachableError: TLS is required but not in use; who sits in between could pass the signature on.
        """
        if encrypted and not self._client.is_encrypted:
            raise UnreachableError("the server does not offer TLS")
        return base64.b64encode(creds.key.sign(nonce.encode()))

    async def _subscribe(self, subject: str, callback: Callback, queue: str = "") -> Subscription:
        async def on_message(msg: Msg) -> None:
            await callback(Message(msg.subject, msg.data, msg.headers or {}, msg.reply))

        return await self._client.subscribe(
            subject,
            queue=queue,
            cb=on_message,
            pending_msgs_limit=MAX_WAITING_MESSAGES,
            pending_bytes_limit=MAX_WAITING,
        )

    async def _flush(self) -> None:
        await self._client.flush(CONNECT_TIMEOUT_S)  # type: ignore[arg-type]  # any number of seconds
        _repeat_cancellation()

    async def _on_error(self, error: Exception) -> None:
        self._reported = error
        self._not_taken.dropped += isinstance(error, nats_errors.SlowConsumerError)
        self._listener.on_error(_text(error))

    async def _on_closed(self) -> None:
        farewell = self._client.farewell
        error = nats_errors.Error(farewell) if farewell else self._client.last_error
        self._listener.on_lost(_connect_error(self._address, error or nats_errors.ConnectionClosedError()))


def _tls_context(ca: Path) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_verify_locations(ca)
    except (OSError, ssl.SSLError) as error:
        raise UnreachableError(f"the CA certificate {ca} can't be read: {error}") from error
    return context


def _text(error: Exception) -> str:
    return (str(error) or type(error).__name__).removeprefix("nats: ").strip("'").lower()


def _lost(error: Exception) -> UnreachableError:
    return UnreachableError(f"the connection to the hub is lost: {_text(error)}")


@contextmanager
def _raising_lost() -> Iterator[None]:
    """Raises an error of the library as the loss of the connection."""
    try:
        yield
    except nats_errors.Error as error:
        raise _lost(error) from error


def _too_large(payload: bytes) -> HubError:
    return HubError(HubReason.TOO_LARGE, f"{len(payload)} bytes exceed the hub's limit for one message")


def _connect_error(server: str, error: Exception) -> HubError:
    if isinstance(error, HubError):
        return error
    text = _text(error)
    if "connections exceeded" in text:
        # Of the server, or of the account; the credentials are as good as before.
        return UnreachableError(f"{server} has as many connections as it permits: {text}")
    if "authentication timeout" in text:
        # Said by a server that has waited for the login for longer than it does.
        return UnreachableError(f"{server} can't be reached: the login took too long ({text})")
    if any(word in text for word in _REFUSALS) or isinstance(error, nats_errors.AuthorizationError):
        return RefusedError(
            f"{server} does not accept the credentials ({text}): revoked, expired, or not of this hub"
        )
    return UnreachableError(f"{server} can't be reached: {text}")


def _repeat_cancellation() -> None:
    """Raises the cancellation of this task that the library may have lost.

    It uses asyncio.wait_for, which before Python 3.12 loses one that comes together with its result
    (bpo-42130); the task would go on for ever.
    """
    task = asyncio.current_task()
    if task and task.cancelling():
        raise asyncio.CancelledError
