"""The connection to the hub, as programs use it: always there, and honest about whether it stands.

`connect` returns at once. A supervisor keeps one session (fleet/session.py) with one of the servers. While
there is none, calls fail at once with `UnreachableError`: nothing is buffered here, an outbox is its owner's.
What runs for long (`follow`, `pull`, `serve`) outlives the sessions.

| what happens | what follows |
|---|---|
| no server answers | every server once in random order, then a pause of 1 s to 60 s with jitter, for ever |
| a server is silent | after 1 s the next one is tried beside it, and the first that answers is taken |
| the hub does not accept the credentials | the same; `link.reason` is REFUSED, also beside a silent one |
| the connection is half-open, or its node silent | found by pings within 15 s, then as lost |
| the connection is lost | what waits for an answer fails with UNREACHABLE; at once on to another server |
| a node dies | as lost; until its streams have a leader again, they fail with NO_RESPONDERS or TIMEOUT |
"""

import asyncio
import random
from collections.abc import AsyncGenerator, Collection
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Final

from common.broadcast import Broadcast
from common.jittered_backoff import JitteredBackoff
from common.tasks import cancel
from fleet import consuming, direct
from fleet.consuming import Delivery
from fleet.direct import Start, StoredMessage
from fleet.errors import HubError, HubReason, RefusedError, UnreachableError, api_error, is_repeat
from fleet.incoming import OPERATION
from fleet.opening import first_to_open
from fleet.present import present
from fleet.replies import NO_RESPONDERS, Message, NotTaken, parsed
from fleet.serving import Handler, Service, serve_in
from fleet.session import Session

__all__ = [
    "Delivery",
    "Entry",
    "FleetAddress",
    "Hub",
    "Link",
    "NotTaken",
    "Published",
    "Start",
    "StoredMessage",
    "connect",
]

REQUEST_TIMEOUT_S: Final = 5.0
"""For an answer of the hub. A stream elects a leader in about that time."""
_STEADY_S: Final = 10.0
"""A connection that stood this long was a success: the next pause is short again. So was reading for this
long, though no message came: a hub that gives no answer is found out sooner."""


@dataclass(frozen=True, slots=True)
class FleetAddress:
    """Where the hub is, and as whom to connect.

    Attributes:
        servers: as "tls://host:4222", in any order; all are nodes of one hub. Without port: 4222.
        credentials: a .creds file; None connects without (tests).
        ca: PEM file of the authority of the servers' certificates; with it a connection without TLS is
            refused. None connects without TLS (tests).
        inbox: prefix of the subjects that answers come to: `names.inbox_prefix(robot)` for a robot.
        name: shown in the servers' lists of connections.
    """

    servers: tuple[str, ...]
    credentials: Path | None = None
    ca: Path | None = None
    inbox: str = "_INBOX"
    name: str = ""


@dataclass(frozen=True, slots=True)
class Link:
    """Whether there is a connection.

    Attributes:
        connected: whether one stands.
        server: to which one; empty without.
        reason: why there is none: UNREACHABLE or REFUSED. None while there is one, and before the first try.
        text: the same for people.
        since_s: of the event loop's clock: since when it is so.
        connections: that stood so far.
    """

    connected: bool
    server: str
    reason: HubReason | None
    text: str
    since_s: float
    connections: int


class Published(Enum):
    """What became of a message in a stream with one message per subject."""

    DELIVERED = "delivered"
    REPEATED = "repeated"
    """The stream has one with this subject: an earlier attempt was delivered."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A key of a bucket.

    Attributes:
        key: without the bucket.
        value: empty if deleted.
        revision: counts up with each change in the bucket.
        unix_s: when the hub took it, by the hub's clock.
        deleted: whether it was deleted.
        pending: values of the bucket still to come when this one was sent; 0: it is the newest one; None: the
            hub does not say (before 2.11).
    """

    key: str
    value: bytes
    revision: int
    unix_s: float
    deleted: bool
    pending: int | None


class Hub:
    """The hub as seen from one program. Made by `connect`."""

    def __init__(self, address: FleetAddress) -> None:
        self._address = address
        self._session: Session | None = None
        self._last_server = ""
        self._refusal = ""
        """Of a server, in the present attempt at them all; empty: none refuses yet, or one has accepted."""
        self._accepted = False
        """Whether a server has accepted in the present attempt."""
        self._services: list[Service] = []
        self._calls: set[asyncio.Task[None]] = set()
        self._supervisor: asyncio.Task[None] | None = None
        self._link = Link(False, "", None, "", asyncio.get_running_loop().time(), 0)
        self.changed = Broadcast()
        """Notified after each change of `link`."""
        self.not_taken = NotTaken()
        """Over all connections."""

    @property
    def link(self) -> Link:
        """Whether there is a connection."""
        return self._link

    async def connected(self, timeout_s: float | None = None, *, once: bool = False) -> None:
        """Waits until there is a connection.

        Args:
            timeout_s: for how long; None: without end.
            once: whether to wait no longer than until all servers have been tried in vain.

        Raises:
            HubError: there was none by then; its reason is that of the last attempt. REFUSED also where one
                server has refused in the present attempt, and others have not answered yet.
        """
        await self.changed.wait_until(
            lambda: self._stands() or (once and self._link.reason is not None), timeout_s
        )
        if self._stands():
            return
        if self._link.reason is HubReason.REFUSED:
            raise RefusedError(self._link.text)
        if self._refusal:
            raise RefusedError(self._refusal)
        raise UnreachableError(self._link.text or f"the hub does not answer within {timeout_s:g} s")

    async def pause(self, longest_s: float) -> None:
        """Waits before something is tried again; no longer than until there is another connection."""
        connections = self._link.connections
        await self.changed.wait_until(lambda: self._link.connections != connections, longest_s)

    async def publish_once(
        self, subject: str, payload: bytes, timeout_s: float = REQUEST_TIMEOUT_S
    ) -> Published:
        """Publishes to a stream that keeps one message per subject, and returns once it is on its disks.

        Raises:
            HubError: it is not certain that the stream has it. Publish the same again.
        """
        try:
            acknowledged(await self._open().request(subject, payload, timeout_s))
        except HubError as error:
            if is_repeat(error):
                return Published.REPEATED
            raise
        return Published.DELIVERED

    async def put(self, bucket: str, key: str, value: bytes, timeout_s: float = REQUEST_TIMEOUT_S) -> None:
        """Sets a key of a bucket.

        Raises:
            HubError: it is not certain that the bucket has it.
        """
        acknowledged(await self._open().request(f"$KV.{bucket}.{key}", value, timeout_s))

    async def delete(self, bucket: str, key: str, timeout_s: float = REQUEST_TIMEOUT_S) -> None:
        """Deletes a key of a bucket; it need not exist.

        Raises:
            HubError: it is not certain that it is deleted.
        """
        headers = {OPERATION: "DEL"}
        acknowledged(await self._open().request(f"$KV.{bucket}.{key}", b"", timeout_s, headers))

    async def entries(
        self, bucket: str, keys: str = ">", timeout_s: float = REQUEST_TIMEOUT_S
    ) -> dict[str, Entry]:
        """Returns the present entries of a bucket, by key.

        Args:
            bucket: its name.
            keys: which of it, as "r1.>".
            timeout_s: for each answer of the hub.

        Raises:
            HubError: it can't be read; TOO_MANY: it has more than is read at once (fleet/present.py).
        """
        found: dict[str, Entry] = {}
        present_ones = present(self._open(), f"KV_{bucket}", f"$KV.{bucket}.{keys}", timeout_s)
        async with aclosing(present_ones) as messages:
            async for message in messages:
                entry = _entry(bucket, message)
                # What changes while it is read comes once more.
                found.pop(entry.key, None)
                if not entry.deleted:
                    found[entry.key] = entry
        return found

    async def watch_bucket(self, bucket: str) -> AsyncGenerator[Entry, None]:
        """Yields the present entries of a bucket and then every change, over all lost connections."""
        async with aclosing(self.follow(f"KV_{bucket}", f"$KV.{bucket}.>", Start.all())) as messages:
            async for message in messages:
                yield _entry(bucket, message)

    async def follow(self, stream: str, subjects: str, start: Start) -> AsyncGenerator[StoredMessage, None]:
        """Yields the messages of a stream in order, each once, over all lost connections.

        Args:
            stream: its name.
            subjects: which of it, as "fleet.r1.ev.>".
            start: where to begin.
        """
        place = start
        pause = JitteredBackoff()
        while True:
            await self.connected()
            since_s = asyncio.get_running_loop().time()
            try:
                following = direct.follow(self._open(), stream, subjects, place, REQUEST_TIMEOUT_S)
                async with aclosing(following) as messages:
                    async for message in messages:
                        pause.reset()
                        place = Start.after(message.sequence)
                        yield message
            except HubError:
                await self._pause_after(pause, since_s)

    async def last(
        self, stream: str, subjects: str, timeout_s: float = REQUEST_TIMEOUT_S
    ) -> StoredMessage | None:
        """Returns the newest message of a stream with such a subject; None if there is none.

        Raises:
            HubError: it can't be read.
        """
        return await direct.last(self._open(), stream, subjects, timeout_s)

    async def count(self, stream: str, subjects: str, timeout_s: float = REQUEST_TIMEOUT_S) -> int:
        """Returns how many messages of a stream have such subjects; for the administration.

        Raises:
            HubError: it can't be read.
        """
        return await consuming.count(self._open(), stream, subjects, timeout_s)

    async def pull(self, stream: str, durable: str, batch: int = 16) -> AsyncGenerator[Delivery, None]:
        """Yields the messages of a durable consumer, over all lost connections. Each needs its `ack`."""
        pause = JitteredBackoff()
        while True:
            await self.connected()
            since_s = asyncio.get_running_loop().time()
            try:
                async with aclosing(consuming.pull(self._open(), stream, durable, batch)) as deliveries:
                    async for delivery in deliveries:
                        pause.reset()
                        yield delivery
            except HubError:
                await self._pause_after(pause, since_s)

    async def request(self, subject: str, payload: bytes, timeout_s: float = REQUEST_TIMEOUT_S) -> bytes:
        """Sends a request to another program and returns its answer.

        Raises:
            HubError: NO_RESPONDERS if no program serves the subject, TIMEOUT, UNREACHABLE ...
        """
        return (await self._open().request(subject, payload, timeout_s)).payload

    async def request_many(
        self, subject: str, payload: bytes, silence_s: float = REQUEST_TIMEOUT_S
    ) -> AsyncGenerator[bytes, None]:
        """Sends a request and yields its answers for as long as the caller asks for more.

        Args:
            subject: of the request.
            payload: of the request.
            silence_s: longest time between two answers.

        Raises:
            HubError: NO_RESPONDERS if no program serves the subject, TIMEOUT after a silence, UNREACHABLE ...
        """
        session = self._open()
        with session.waiter(subject) as (waiter, reply):
            await session.send(subject, payload, reply)
            while True:
                message = await waiter.get(silence_s)
                if message.status == NO_RESPONDERS and not message.payload:
                    raise HubError(HubReason.NO_RESPONDERS, f"no program at the hub takes {subject}")
                yield message.payload

    async def serve(
        self,
        subject: str,
        queue: str,
        handler: Handler,
        *,
        at_once: int = 8,
        of_one: int | None = None,
        busy: bytes = b"",
        of_people: bool = False,
        long: Collection[str] = (),
    ) -> None:
        """Answers requests, on subjects "fleet.<robot>.<kind>.<name>", over all lost connections.

        A robot's request whose answer would not go to the inbox of the robot in its subject is dropped: a
        hostile robot could name another one's. So is a person's whose answer would go to no inbox: it would
        be published with the rights of this program.

        Args:
            subject: which requests.
            queue: group of programs of which one gets each request.
            handler: answers one; it handles its own errors.
            at_once: requests in hand at any moment.
            of_one: of these, about one robot; None: all of them.
            busy: answer to requests beyond that.
            of_people: whether they are those of people, whose inboxes have no robot's name.
            long: names of requests that take minutes: `at_once` and `of_one` hold for them and for the others
                each, so that the others are answered meanwhile.
        """
        service = Service(
            subject, queue, handler, at_once, of_one or at_once, busy, of_people, frozenset(long)
        )
        self._services.append(service)
        if self._session is not None:
            await serve_in(self._session, service, self._calls)

    async def api(
        self, call: str, request: Any = None, timeout_s: float = REQUEST_TIMEOUT_S
    ) -> dict[str, Any]:
        """Calls JetStream's API, as "STREAM.INFO.fleet_events".

        Raises:
            HubError: with JetStream's code.
        """
        return await self._open().api(f"$JS.API.{call}", request, timeout_s)

    async def stream_info(self, stream: str, timeout_s: float = REQUEST_TIMEOUT_S) -> dict[str, Any]:
        """Returns JetStream's StreamInfo of a stream.

        Raises:
            HubError: with JetStream's code.
        """
        return await direct.stream_info(self._open(), stream, None, timeout_s)

    async def consumer_info(self, subject: str, timeout_s: float = REQUEST_TIMEOUT_S) -> dict[str, Any]:
        """Requests JetStream's ConsumerInfo by a subject that the account has it under.

        Raises:
            HubError: with JetStream's code.
        """
        return await self._open().api(subject, None, timeout_s)

    async def run(self) -> None:
        """Keeps a connection until it is cancelled."""
        backoff = JitteredBackoff()
        loop = asyncio.get_running_loop()
        while True:
            session = await self._try_servers()
            if session is None:
                await backoff.wait()
                continue
            since_s = loop.time()
            try:
                await self._use(session)
            finally:
                await session.close()
            if loop.time() - since_s >= _STEADY_S:
                backoff.reset()
            else:
                await backoff.wait()

    def supervise(self) -> asyncio.Task[None]:
        """Begins to keep a connection; returns the task, which its owner cancels."""
        self._supervisor = asyncio.create_task(self.run())
        return self._supervisor

    async def lasting(self) -> None:
        """Waits for a defect that ends the supervisor, which makes all connections, and raises it.

        A part of bridge, receiver, exporter and `robotctl fleet watch`, which wait for the hub for as long as
        it takes: without this, they would stay without the hub.
        """
        if self._supervisor is None:
            raise RuntimeError("nothing makes connections to the hub")
        await asyncio.wait([self._supervisor])
        if not self._supervisor.cancelled():
            self._supervisor.result()
        raise RuntimeError("what makes connections to the hub has ended")

    async def close(self) -> None:
        """Ends the requests in hand."""
        await cancel(self._calls)

    async def _try_servers(self) -> Session | None:
        """Tries every server once, in random order, and the one that was lost last of all."""
        self._refusal, self._accepted = "", False
        servers = list(self._address.servers)
        random.shuffle(servers)
        # One that was lost because it is silent is silent to a new connection as well.
        servers.sort(key=lambda server: server == self._last_server)
        try:
            return await first_to_open(servers, self._open_session)
        except HubError as error:
            self._set(False, "", error)
            return None

    async def _open_session(self, server: str) -> Session:
        address = self._address
        try:
            session = await Session.open(
                server,
                credentials=address.credentials,
                ca=address.ca,
                inbox=address.inbox,
                name=address.name,
                not_taken=self.not_taken,
            )
        except RefusedError as error:
            if not self._accepted:
                self._refusal = str(error)
            raise
        # Before the other attempts have ended, which may take longer than a caller waits.
        self._refusal, self._accepted = "", True
        return session

    async def _use(self, session: Session) -> None:
        try:
            for service in self._services:
                await serve_in(session, service, self._calls)
        except HubError as error:
            self._set(False, "", error)
            return
        self._session, self._last_server = session, session.server
        self._set(True, session.server, None)
        try:
            reason = await asyncio.shield(session.lost)
        finally:
            self._session = None
        self._set(False, "", reason)

    def _set(self, connected: bool, server: str, error: HubError | None) -> None:
        now_s = asyncio.get_running_loop().time()
        same = connected == self._link.connected
        self._link = Link(
            connected,
            server,
            error.reason if error else None,
            str(error) if error else "",
            self._link.since_s if same else now_s,
            self._link.connections + connected,
        )
        self.changed.notify_all()

    def _stands(self) -> bool:
        # Of a session that was lost just now, `link` says so once the supervisor has had its turn. If callers
        # were let through until then, one that repeats what fails would keep the event loop from that turn.
        lost = self._session is not None and self._session.lost.done()
        return self._link.connected and not lost

    def _open(self) -> Session:
        if self._session is None:
            if self._link.reason is HubReason.REFUSED:
                raise RefusedError(self._link.text)
            raise UnreachableError(self._link.text or "there is no connection to the hub yet")
        return self._session

    async def _pause_after(self, backoff: JitteredBackoff, since_s: float) -> None:
        """As `pause`, for the next pause of a backoff, which begins anew after a success.

        Args:
            backoff: of what has failed.
            since_s: of the event loop's clock: since when it had been tried.
        """
        if asyncio.get_running_loop().time() - since_s >= _STEADY_S:
            backoff.reset()
        await self.pause(backoff.next_s())


@asynccontextmanager
async def connect(address: FleetAddress) -> AsyncGenerator[Hub, None]:
    """Keeps a connection to the hub while the block runs. It need not stand yet when the block begins."""
    hub = Hub(address)
    supervisor = hub.supervise()
    try:
        yield hub
    finally:
        await cancel([supervisor])
        await hub.close()


def acknowledged(message: Message) -> None:
    """Checks that a message is the acknowledgement of a stream.

    Raises:
        HubError: it is an error, or anything else.
    """
    if "stream" not in parsed(message.payload):
        raise api_error({"description": "the answer to a message is no acknowledgement"})


def _entry(bucket: str, message: StoredMessage) -> Entry:
    return Entry(
        key=message.subject.removeprefix(f"$KV.{bucket}."),
        value=message.payload,
        revision=message.sequence,
        unix_s=message.unix_s,
        deleted=message.headers.get(OPERATION) in {"DEL", "PURGE"},
        pending=message.pending,
    )
