"""Carries out a following for asyncio: a task receives, the caller iterates."""

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import grpc

from console.client.error_table import error_from, stream_error_from
from console.client.errors import Cancelled, DeadlineExceeded, GatewayError
from console.client.exchange import Pause, Send
from console.client.following import Following, Open, Read, StreamStep, Tell, go_on
from console.client.mailbox import MOST_WAITING

Begin = Callable[[Open], Any]
"""Makes the call that a step asks for."""
Ask = Callable[[Send[Any, Any]], Awaitable[Any]]
"""Carries out a call with one answer, which it returns, or the error."""


async def follow(
    following: Following, begin: Begin, send: Ask, target: str, closed: asyncio.Event
) -> AsyncIterator[Any]:
    """What the following tells, as it comes; ends its call when the caller stops iterating.

    Raises:
        GatewayError: there is no use in going on, or the client was closed.
    """
    call: _Call | None = None
    try:
        step: StreamStep = go_on(following, None)
        while True:
            outcome: Any = None
            match step:
                case Tell(item):
                    yield item
                case Pause(seconds):
                    await _wait(closed, seconds)
                case Open():
                    if call:
                        call.end()
                    call = _Call(step, begin, target)
                case Send():
                    outcome = await send(step)
                case Read(within_s) if call:
                    outcome = await call.read(within_s)
            if closed.is_set():
                outcome = Cancelled("this client is closed")
            step = go_on(following, outcome)
    finally:
        if call:
            call.end()


class _Call:
    """One call and the task that receives it."""

    def __init__(self, step: Open, begin: Begin, target: str) -> None:
        self._newest_only = step.newest_only
        self._items: deque[Any] = deque(maxlen=1 if step.newest_only else None)
        self._ended_with: GatewayError | None = None
        self._changed = asyncio.Condition()
        self._task = asyncio.create_task(self._receive(begin, step, target), name="gateway-stream")

    async def read(self, within_s: float) -> Any | GatewayError:
        """The next answer, or why there is none."""
        try:
            async with asyncio.timeout(within_s), self._changed:
                await self._changed.wait_for(lambda: self._items or self._ended_with)
                if not self._items:
                    return self._ended_with
                self._changed.notify_all()
                return self._items.popleft()
        except TimeoutError:
            return DeadlineExceeded(f"the robot gateway sent nothing for {within_s:.1f} s")

    def end(self) -> None:
        """Lets the task go; the call ends with it."""
        self._task.cancel()

    async def _receive(self, begin: Begin, step: Open, target: str) -> None:
        call = begin(step)
        try:
            async for answer in call:
                async with self._changed:
                    await self._changed.wait_for(self._has_room)
                    self._items.append(answer)
                    self._changed.notify_all()
            trouble = stream_error_from(None, target)
        except grpc.RpcError as failure:
            trouble = stream_error_from(error_from(failure, target, 0.0), target)
        except asyncio.CancelledError:
            call.cancel()
            # gRPC says so, too, when the channel was closed under the call.
            if not self._task.cancelling():
                await self._end(Cancelled("this client was closed"))
                return
            raise
        await self._end(trouble)

    async def _end(self, trouble: GatewayError) -> None:
        async with self._changed:
            self._ended_with = trouble
            self._changed.notify_all()

    def _has_room(self) -> bool:
        return self._newest_only or len(self._items) < MOST_WAITING


async def _wait(closed: asyncio.Event, seconds: float) -> None:
    try:
        async with asyncio.timeout(seconds):
            await closed.wait()
    except TimeoutError:
        return
