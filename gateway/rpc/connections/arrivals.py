"""Notices that a caller connects, beside gRPC, which accepts the connection and does not report it."""

import asyncio
import socket
from collections.abc import Sequence
from contextlib import suppress
from types import TracebackType
from typing import Self


class Arrivals:
    """Watches sockets of which another part of the program accepts connections, in a `with` block.

    A connection that is accepted before the event loop has looked goes unnoticed; of a crowd, some do not.

    Args:
        listening: the sockets.
    """

    def __init__(self, listening: Sequence[socket.socket]) -> None:
        self._listening = listening
        self._loop = asyncio.get_running_loop()
        self._came = asyncio.Event()
        self._watching = False

    def __enter__(self) -> Self:
        self._watch()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._rest()

    async def next(self, within_s: float) -> bool:
        """Returns whether a caller has connected since the last one was noticed, or does `within_s`."""
        self._watch()
        with suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                await self._came.wait()
        came = self._came.is_set()
        self._came.clear()
        return came

    def _watch(self) -> None:
        if not self._watching:
            self._watching = True
            for each in self._listening:
                self._loop.add_reader(each, self._note)

    def _note(self) -> None:
        # Once: a connection can be read of until it is accepted.
        self._rest()
        self._came.set()

    def _rest(self) -> None:
        if self._watching:
            self._watching = False
            for each in self._listening:
                self._loop.remove_reader(each)
