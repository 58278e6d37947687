"""Reading what is in a stream now. The stream has one message per subject.

| what happens | what follows |
|---|---|
| a message changes meanwhile | it comes, or comes once more |
| the hub is older than 2.11 | the subjects are read first, and then the newest message of each |
| there is more than is read at once | HubError |
"""

from collections.abc import AsyncGenerator
from contextlib import aclosing
from typing import Final

from fleet.direct import StoredMessage, batch, last, stream_info
from fleet.errors import HubError, HubReason
from fleet.session import Session

MOST_PRESENT: Final = 100_000
"""Messages that are read at once (`present`): ten times the robots that a console shows."""
MOST_PRESENT_BYTES: Final = 256 * 1024 * 1024
"""Bytes of their contents: they are all in memory, and a hub could send without end."""


async def present(
    session: Session, stream: str, subjects: str, timeout_s: float
) -> AsyncGenerator[StoredMessage, None]:
    """Yields the messages that are in a stream now, and ends. The stream has one message per subject.

    Raises:
        HubError: it can't be read; TOO_MANY: there are more than MOST_PRESENT, or MOST_PRESENT_BYTES.
    """
    sequence, read = 1, _Read(stream)
    pending: int | None = None
    while pending != 0:
        pending = 0
        async with aclosing(batch(session, stream, subjects, sequence, timeout_s)) as messages:
            async for message in messages:
                sequence, pending = message.sequence + 1, message.pending
                if pending is None:
                    break
                read.add(message, pending)
                yield message
        if pending is None:
            async with aclosing(_one_by_one(session, stream, subjects, timeout_s)) as messages:
                async for message in messages:
                    yield message
            return


async def _one_by_one(
    session: Session, stream: str, subjects: str, timeout_s: float
) -> AsyncGenerator[StoredMessage, None]:
    """Yields the newest message of each subject, with a request for each.

    In the order of their sequences, a request for each would not come to an end where as many messages change
    meanwhile, and to end at the newest of the beginning would leave out those that have changed.
    """
    read = _Read(stream)
    found = await _subjects(session, stream, subjects, timeout_s)
    read.check(len(found))
    for subject in found:
        if message := await last(session, stream, subject, timeout_s):
            read.add(message)
            yield message


async def _subjects(session: Session, stream: str, subjects: str, timeout_s: float) -> list[str]:
    """Returns the subjects of a stream's messages."""
    info = await stream_info(session, stream, {"subjects_filter": subjects}, timeout_s)
    state = info.get("state")
    found = state.get("subjects", {}) if isinstance(state, dict) else None
    if not isinstance(found, dict):
        raise HubError(HubReason.INVALID, f"the hub does not say which subjects {stream} has")
    return list(found)


class _Read:
    """How much of a stream was read at once, against what is permitted.

    Args:
        stream: its name.
    """

    def __init__(self, stream: str) -> None:
        self._stream = stream
        self._count = self._size = 0

    def add(self, message: StoredMessage, pending: int = 0) -> None:
        """Takes one, and how many follow.

        Raises:
            HubError: it is too much.
        """
        self._count += 1
        self._size += len(message.payload)
        self.check(pending)
        if self._size > MOST_PRESENT_BYTES:
            raise self._too_many(f"{MOST_PRESENT_BYTES} bytes")

    def check(self, pending: int) -> None:
        """Raises a HubError if so many more are too many."""
        if self._count + pending > MOST_PRESENT:
            raise self._too_many(f"{MOST_PRESENT} messages")

    def _too_many(self, most: str) -> HubError:
        return HubError(HubReason.TOO_MANY, f"{self._stream} has more than the {most} that are read at once")
