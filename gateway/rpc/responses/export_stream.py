"""Exports of recordings: how many there may be, how long each may wait for its reader, what has left."""

import asyncio
from collections import Counter
from collections.abc import AsyncGenerator, AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from common.errors import TooMuchError
from common.open_file import Chunk
from common.reasons import Reason
from gateway.links.recorder.calls import RecorderCalls
from gateway.rpc.mapping.export import message_parts

MAX_OF_A_CALLER: Final = 4
MAX_OF_ALL: Final = 8
"""The schema documents both, and the next one."""
STALLED_S: Final = 60.0
"""A caller that has not taken a chunk for so long loses its place."""


class Rank(IntEnum):
    """Whose export it is; the value is how many others may run beside it."""

    VIEWER = MAX_OF_ALL - 3
    """One place is kept for operators, and one for the bridge."""
    OPERATOR = MAX_OF_ALL - 2
    BRIDGE = MAX_OF_ALL - 1


@dataclass(frozen=True, slots=True)
class ExportCaller:
    """Who exports.

    Attributes:
        name: for people.
        rank: which places it may take.
        counted_as: whose exports these are (`CallContext.caller`).
    """

    name: str
    rank: Rank
    counted_as: str


class ExportStream:
    """Passes exports on, a chunk when the one before has left: a slow reader slows the recorder's disk down.

    Attributes:
        sent_bytes: of all exports, with what frames the chunks.
    """

    def __init__(self) -> None:
        self._open: Counter[str] = Counter()
        """By caller."""
        self.sent_bytes = 0

    @property
    def open(self) -> int:
        """Exports that run."""
        return self._open.total()

    async def responses(
        self, calls: RecorderCalls, request: bytes, caller: ExportCaller
    ) -> AsyncIterator[bytes]:
        """Yields the responses of one export, serialised.

        Args:
            calls: to the recorder.
            request: the caller's, serialised.
            caller: whose exports are counted.

        Raises:
            TooMuchError: there are as many as permitted, or the caller has taken nothing for STALLED_S.
            DomainError: the recorder refuses, or is gone.
        """
        self._check_free(caller)
        place = _Place(self._open, caller.counted_as, calls.export(request, caller.name))
        try:
            async for each in place.responses:
                response = each if isinstance(each, bytes) else b"".join(message_parts(each))
                self.sent_bytes += len(response)
                with place.lost_after(STALLED_S):
                    yield response
                place.check()
        finally:
            await place.close()

    def _check_free(self, caller: ExportCaller) -> None:
        if self._open[caller.counted_as] >= MAX_OF_A_CALLER:
            raise TooMuchError(
                f"you have {MAX_OF_A_CALLER} exports running, and no more are allowed; wait until one ends",
                Reason.TOO_MANY_EXPORTS,
            )
        if self.open > caller.rank:
            raise TooMuchError(
                f"{self.open} exports run, and no more are allowed at once; wait until one ends",
                Reason.TOO_MANY_EXPORTS,
            )


class _Place:
    """The place of one export, which is lost when a response is not taken in time.

    Args:
        taken: places by caller; this one is counted there.
        caller: whose it is.
        responses: of the recorder.
    """

    def __init__(self, taken: Counter[str], caller: str, responses: AsyncGenerator[bytes | Chunk]) -> None:
        self.responses = responses
        self._taken = taken
        self._caller = caller
        self._closing: asyncio.Task[None] | None = None
        taken[caller] += 1

    @contextmanager
    def lost_after(self, seconds: float) -> Iterator[None]:
        """Loses the place unless the block ends in time.

        The call itself stays: gRPC can end it in order only after what it has still to deliver. Until then it
        counts as a stream of the caller's connection.
        """
        losing = asyncio.get_running_loop().call_later(seconds, self._give_back)
        try:
            yield
        finally:
            losing.cancel()

    def check(self) -> None:
        """Raises a TooMuchError if the place has been lost."""
        if self._closing:
            raise TooMuchError(
                f"this export took nothing for {STALLED_S:g} s and has lost its place; go on where it ended",
                Reason.EXPORT_STALLED,
            )

    async def close(self) -> None:
        """Gives the place back, and returns when nothing more is read for it."""
        await self._give_back()

    def _give_back(self) -> "asyncio.Task[None]":
        if self._closing is None:
            self._taken[self._caller] -= 1
            if not self._taken[self._caller]:
                del self._taken[self._caller]
            self._closing = asyncio.create_task(self.responses.aclose())
        return self._closing
