"""Exports of recordings: how many there may be, and how much has left."""

from collections import Counter
from collections.abc import AsyncIterator
from contextlib import aclosing
from typing import Final

from common.errors import TooMuchError
from common.reasons import Reason
from gateway.links.recorder.calls import RecorderCalls
from gateway.rpc.mapping.export import message_parts

MAX_OF_A_CALLER: Final = 4
MAX_OF_ALL: Final = 8
"""The schema documents both."""


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

    async def responses(self, calls: RecorderCalls, request: bytes, caller: str) -> AsyncIterator[bytes]:
        """Yields the responses of one export, serialised.

        Args:
            calls: to the recorder.
            request: the caller's, serialised.
            caller: whose exports are counted.

        Raises:
            TooMuchError: there are as many as permitted.
            DomainError: the recorder refuses, or is gone.
        """
        if self._open[caller] >= MAX_OF_A_CALLER:
            raise TooMuchError(
                f"you have {MAX_OF_A_CALLER} exports running, and no more are allowed; wait until one ends",
                Reason.TOO_MANY_EXPORTS,
            )
        if self.open >= MAX_OF_ALL:
            raise TooMuchError(
                f"{MAX_OF_ALL} exports run, and no more are allowed at once; wait until one ends",
                Reason.TOO_MANY_EXPORTS,
            )
        self._open[caller] += 1
        try:
            async with aclosing(calls.export(request, caller)) as responses:
                async for each in responses:
                    response = each if isinstance(each, bytes) else b"".join(message_parts(each))
                    self.sent_bytes += len(response)
                    yield response
        finally:
            self._open[caller] -= 1
            if not self._open[caller]:
                del self._open[caller]
