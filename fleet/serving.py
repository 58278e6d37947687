"""Requests that a program answers: how many at once, and where the answers may go."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final

from fleet import names
from fleet.replies import Message
from fleet.session import Session

_ROUTED: Final = "_R_."
"""Reply subjects that the server makes for a request from another account; clients can't name such a one."""


class Request:
    """A request of a robot, or of a person about one; the answers go to its sender.

    Attributes:
        robot: by the subject, which the hub enforces.
        name: last part of the subject: "begin_file".
        payload: as sent.
    """

    def __init__(self, robot: str, name: str, payload: bytes, session: Session, reply: str) -> None:
        self.robot = robot
        self.name = name
        self.payload = payload
        self._session = session
        self._reply = reply

    async def respond(self, payload: bytes) -> None:
        """Sends an answer; there may be several.

        Raises:
            HubError: it can't be sent.
        """
        await self._session.publish(self._reply, payload)


Handler = Callable[[Request], Awaitable[None]]


@dataclass(frozen=True, slots=True)
class Service:
    """What a program answers: see `fleet.connection.Hub.serve`."""

    subject: str
    queue: str
    handler: Handler
    at_once: int
    of_one: int
    busy: bytes
    of_people: bool
    long: frozenset[str]


async def serve_in(session: Session, service: Service, calls: set[asyncio.Task[None]]) -> None:
    """Answers requests for as long as the session stands.

    Args:
        session: to serve in.
        service: what is answered, and how.
        calls: has the requests in hand, of all services.

    Raises:
        HubError: the session is lost.
    """
    running: dict[asyncio.Task[None], tuple[str, bool]] = {}
    """With the robot, and whether it is one of those that take long."""

    async def on_message(message: Message) -> None:
        parts = message.subject.split(".")
        if len(parts) < 3 or not message.reply.startswith(_inboxes(service, parts[1])):
            return
        request = Request(parts[1], parts[-1], message.payload, session, message.reply)
        is_long = request.name in service.long
        alike = [robot for robot, long in running.values() if long is is_long]
        if len(alike) >= service.at_once or alike.count(request.robot) >= service.of_one:
            await request.respond(service.busy)
            return
        task = asyncio.ensure_future(service.handler(request))
        running[task] = request.robot, is_long
        calls.add(task)
        task.add_done_callback(running.pop)
        task.add_done_callback(calls.discard)

    await session.subscribe(service.subject, service.queue, on_message)


def _inboxes(service: Service, robot: str) -> tuple[str, ...]:
    """Returns where the answer to a request may go."""
    if service.of_people:
        return (f"{names.INBOXES}.", _ROUTED)
    return (f"{names.inbox_prefix(robot)}.", _ROUTED)
