"""Counts what is asked, and who asks."""

import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from common.errors import DomainError
from common.rpc import Context

RECENT_S: Final = 10.0
"""A connection that asked for something, or was told something, this recently counts as a client."""
_MOST_REMEMBERED: Final = 1024
"""Connections; of more than that, the quietest are forgotten."""

Behavior: TypeAlias = Callable[[Any, Context], Awaitable[bytes]]
StreamBehavior: TypeAlias = Callable[[Any, Context], AsyncIterator[bytes]]


@dataclass(slots=True)
class Counts:
    """What became of the calls of one method."""

    served: int = 0
    refused: int = 0
    failed: int = 0
    open: int = 0
    """Streams that go on."""


class Tally:
    """Belongs to one event loop.

    Args:
        clock: seconds, monotonic.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._asked_at_s: dict[str, float] = {}
        """By connection, the one that asked last at the end."""
        self.methods: dict[str, Counts] = {}

    @property
    def served(self) -> int:
        """Calls answered, of all methods."""
        return sum(counts.served for counts in self.methods.values())

    @property
    def refused(self) -> int:
        """Calls refused, of all methods."""
        return sum(counts.refused for counts in self.methods.values())

    def client_count(self) -> int:
        """How many connections asked for something lately."""
        since_s = self._clock() - RECENT_S
        count = 0
        for asked_at_s in reversed(self._asked_at_s.values()):
            if asked_at_s < since_s:
                break
            count += 1
        return count

    def note(self, peer: str) -> None:
        """This connection asks for something, or is told something."""
        asked = self._asked_at_s
        asked.pop(peer, None)
        asked[peer] = self._clock()
        if len(asked) > _MOST_REMEMBERED:
            del asked[next(iter(asked))]

    def expect(self, methods: Iterable[str]) -> None:
        """These methods have counts from now on, also before their first call."""
        for method in methods:
            self.methods.setdefault(method, Counts())

    def counted(self, method: str, behavior: Behavior) -> Behavior:
        """The same behavior, counted under the method's name."""
        counts = self.methods.setdefault(method, Counts())

        async def call(request: Any, context: Context) -> bytes:
            try:
                reply = await behavior(request, context)
            except DomainError:
                counts.refused += 1
                raise
            except Exception:
                counts.failed += 1
                raise
            counts.served += 1
            return reply

        return call

    def counted_stream(self, method: str, behavior: StreamBehavior) -> StreamBehavior:
        """The same behavior, counted under the method's name: a stream is served when it begins."""
        counts = self.methods.setdefault(method, Counts())

        async def call(request: Any, context: Context) -> AsyncIterator[bytes]:
            peer, begun = context.peer(), False
            counts.open += 1
            try:
                async for reply in behavior(request, context):
                    if not begun:
                        begun = True
                        counts.served += 1
                    self.note(peer)
                    yield reply
            except DomainError:
                counts.refused += 1
                raise
            except Exception:
                counts.failed += 1
                raise
            finally:
                counts.open -= 1

        return call
