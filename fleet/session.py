"""One connection to one server of the hub, with the requests that wait for its replies.

It never reconnects and buffers nothing: when it is lost, everything that waits for it fails at once, and
`fleet.connection` opens another one. What a hostile server may cost is bounded (fleet/nats_client.py).
"""

import asyncio
import json
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

from fleet.errors import HubError, HubReason, RefusedError, UnreachableError
from fleet.nats_client import Callback, NatsClient
from fleet.replies import NO_RESPONDERS, Message, NotTaken, Waiter, parsed


class Session:
    """A connection that stands, until it is lost."""

    def __init__(self, server: str, inbox: str, not_taken: NotTaken) -> None:
        self._client = NatsClient(server, not_taken, self)
        self.server = server
        self._inbox = f"{inbox}.{self._client.new_id()}"
        self._not_taken = not_taken
        self._count = 0
        self._waiters: dict[str, Waiter] = {}
        self.lost: asyncio.Future[HubError] = asyncio.get_running_loop().create_future()
        """Done when the connection is lost, with why."""

    @classmethod
    async def open(
        cls,
        server: str,
        *,
        credentials: Path | None,
        ca: Path | None,
        inbox: str,
        name: str,
        not_taken: NotTaken | None = None,
    ) -> "Session":
        """Connects to a server.

        Args:
            server: as "tls://host:4222".
            credentials: a .creds file.
            ca: authority of the server's certificate.
            inbox: prefix of the subjects that answers come to.
            name: shown in the servers' lists of connections.
            not_taken: counts what is not taken of its messages.

        Raises:
            UnreachableError: it can't be reached, or is not who it has to be.
            RefusedError: it does not accept the credentials.
        """
        session = cls(server, inbox, not_taken or NotTaken())
        await session._client.open(session._inbox, name=name, credentials=credentials, ca=ca)
        return session

    async def close(self) -> None:
        """Closes the connection; what waits for an answer fails."""
        await self._client.close()
        self.on_lost(UnreachableError(f"the connection to {self.server} is closed"))

    async def publish(self, subject: str, payload: bytes) -> None:
        """Hands a message to the connection, without an answer.

        Raises:
            UnreachableError, HubError: it can't be sent.
        """
        await self._publish(subject, payload, "", None)

    async def request(
        self, subject: str, payload: bytes, timeout_s: float, headers: dict[str, str] | None = None
    ) -> Message:
        """Sends a request and returns the first reply.

        Raises:
            HubError: there is none in time, or none can be.
        """
        with self.waiter(subject) as (waiter, reply):
            await self._publish(subject, payload, reply, headers)
            message = await waiter.get(timeout_s)
        if message.status == NO_RESPONDERS and not message.payload:
            raise HubError(HubReason.NO_RESPONDERS, f"nothing at the hub takes {subject}")
        return message

    async def api(self, subject: str, request: Any, timeout_s: float) -> dict[str, Any]:
        """Calls JetStream's API; an empty request is None.

        Raises:
            HubError: with JetStream's code.
        """
        payload = b"" if request is None else json.dumps(request).encode()
        return parsed((await self.request(subject, payload, timeout_s)).payload)

    async def send(self, subject: str, payload: bytes, reply: str) -> None:
        """Sends a request whose replies go to a subject from `waiter`.

        Raises:
            UnreachableError, HubError: it can't be sent.
        """
        await self._publish(subject, payload, reply, None)

    @contextmanager
    def waiter(self, subject: str) -> Iterator[tuple[Waiter, str]]:
        """Yields where the replies to a request on this subject arrive, and the subject that they go to."""
        self._check()
        self._count += 1
        token = str(self._count)
        self._waiters[token] = waiter = Waiter(subject, self._not_taken)
        try:
            yield waiter, f"{self._inbox}.{token}"
        finally:
            del self._waiters[token]

    @asynccontextmanager
    async def channel(self, subject: str) -> AsyncIterator[tuple[Waiter, str]]:
        """As `waiter`, for requests that a stream answers: messages of a stream keep their own subjects.

        The reply subject of each request is the yielded one with one more part.

        Raises:
            UnreachableError: the connection is lost.
        """
        with self.waiter(subject) as (waiter, reply):

            async def on_message(message: Message) -> None:
                waiter.take(message)

            inbox = reply.replace(".", ".s.", 1)
            subscription = await self._client.subscribe(f"{inbox}.*", on_message)
            try:
                yield waiter, inbox
            finally:
                if not self.lost.done() and self._client.is_connected:
                    await subscription.unsubscribe()

    async def subscribe(self, subject: str, queue: str, callback: Callback) -> None:
        """Subscribes for as long as the connection stands; what comes too fast is dropped.

        Raises:
            UnreachableError: the connection is lost.
        """
        await self._client.subscribe(subject, callback, queue)
        # What is published after this, the server passes on.
        await self._client.flush()

    async def on_reply(self, message: Message) -> None:
        """Hands a message of the inbox to what waits for it."""
        waiter = self._waiters.get(message.subject.rpartition(".")[2])
        if waiter is not None:
            waiter.take(message)

    def on_error(self, text: str) -> None:
        """Takes an error that the server reports beside the calls, in lower case."""
        if "permissions violation" not in text:
            return
        for waiter in list(self._waiters.values()):
            if f'"{waiter.subject.lower()}"' in text:
                waiter.refuse(RefusedError(f"the credentials do not permit {waiter.subject}"))

    def on_lost(self, reason: HubError) -> None:
        """Takes the end of the connection; only the first one counts."""
        if self.lost.done():
            return
        self.lost.set_result(reason)
        for waiter in self._waiters.values():
            waiter.replies.put_nowait(reason)

    def _check(self) -> None:
        """Raises why the connection is lost, if it is."""
        if self.lost.done():
            # It is raised for each call, and would keep the place of each.
            raise self.lost.result().with_traceback(None)

    async def _publish(
        self, subject: str, payload: bytes, reply: str, headers: dict[str, str] | None
    ) -> None:
        self._check()
        await self._client.publish(subject, payload, reply, headers)
