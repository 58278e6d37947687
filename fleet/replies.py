"""What comes from the hub, and where the replies to a request wait to be read.

What may wait is bounded, in bytes and in messages: a hub may send more than anything reads. What is not taken
is counted.
"""

import asyncio
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from fleet.errors import HubError, HubReason, api_error
from fleet.incoming import SEQUENCE, STATUS

MAX_WAITING: Final = 8 * 1024 * 1024
"""Bytes that may wait in one subscription, or for one caller."""
MAX_WAITING_MESSAGES: Final = 4096
NO_RESPONDERS: Final = "503"


@dataclass(frozen=True, slots=True)
class Message:
    """A message from the hub."""

    subject: str
    payload: bytes
    headers: Mapping[str, str]
    reply: str

    @property
    def status(self) -> str:
        """JetStream's status code of a message without content, as "404"; empty for an ordinary one.

        One that is stored in a stream has none: what its headers begin with is its sender's.
        """
        return "" if SEQUENCE in self.headers else self.headers.get(STATUS, "")

    @property
    def size(self) -> int:
        """Bytes of the payload, and characters of what is kept besides it."""
        headers = sum(len(name) + len(value) for name, value in self.headers.items())
        return len(self.payload) + len(self.subject) + len(self.reply) + headers


@dataclass(slots=True)
class NotTaken:
    """What was not taken of the messages that a hub has sent.

    Attributes:
        unreadable: headers, subjects and reply subjects that are no text or exceed their bounds.
        dropped: messages beyond what may wait to be read.
    """

    unreadable: int = 0
    dropped: int = 0


class Waiter:
    """Where the replies to one request arrive."""

    def __init__(self, subject: str, not_taken: NotTaken | None = None) -> None:
        self.subject = subject
        self.replies: asyncio.Queue[Message | HubError] = asyncio.Queue()
        self._not_taken = not_taken or NotTaken()
        self._bytes = 0

    def take(self, message: Message) -> None:
        """Keeps a message until it is read; beyond the bounds it is dropped."""
        size = self._bytes + message.size
        if self.replies.qsize() < MAX_WAITING_MESSAGES and size <= MAX_WAITING:
            self._bytes = size
            self.replies.put_nowait(message)
        else:
            self._not_taken.dropped += 1

    def refuse(self, error: HubError) -> None:
        """Has an error raised when all before it has been read; one is enough, and a server may send more."""
        if self.replies.qsize() < MAX_WAITING_MESSAGES:
            self.replies.put_nowait(error)

    async def get(self, timeout_s: float) -> Message:
        """Returns the next one.

        Raises:
            HubError: there is none in time, or the connection is lost.
        """
        try:
            async with asyncio.timeout(timeout_s):
                reply = await self.replies.get()
        except TimeoutError as error:
            text = f"no answer from the hub within {timeout_s:g} s"
            raise HubError(HubReason.TIMEOUT, text) from error
        if isinstance(reply, HubError):
            raise reply
        self._bytes -= reply.size
        return reply


def parsed(payload: bytes) -> dict[str, Any]:
    """Parses an answer of JetStream.

    Raises:
        HubError: it is an error, or no JSON object.
    """
    try:
        answer = json.loads(payload)
    # Deep nesting is a RecursionError.
    except (ValueError, RecursionError) as error:
        raise HubError(HubReason.INVALID, "the hub's answer is no JSON") from error
    if not isinstance(answer, dict):
        raise HubError(HubReason.INVALID, "the hub's answer is no JSON object")
    if "error" in answer:
        raise api_error(answer["error"])
    return answer
