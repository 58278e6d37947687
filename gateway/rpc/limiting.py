"""Every call passes here first. Who wants too much is refused, and waits for the refusal.

To refuse costs nearly as much as to answer: whoever asks again at once would still take the time of all
others. So refusals come late and one by one, and a client that floods is slowed down by its own open calls.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any, Final

import grpc

from common.errors import TooMuchError
from common.rpc import Context, Handler, rewrapped
from gateway.rpc.limits import Admission

_MOST_WAITING: Final = 1024
"""Refusals that wait, for five seconds then; beyond it they come at once, because waiting takes memory."""


class LimitInterceptor(grpc.aio.ServerInterceptor):
    """Belongs to one event loop.

    Args:
        admission: knows what is allowed.
    """

    def __init__(self, admission: Admission) -> None:
        self._admission = admission
        self._waiting = 0

    async def intercept_service(
        self,
        continuation: Callable[[grpc.HandlerCallDetails], Awaitable[Handler | None]],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> Handler | None:
        """Wraps the method's handler; asked once per method."""
        handler = await continuation(handler_call_details)
        return rewrapped(handler, self._unary, self._stream) if handler else None

    def _unary(self, behavior: Any) -> Any:
        async def call(request: Any, context: Context) -> Any:
            try:
                self._admission.request(context.peer())
            except TooMuchError:
                await self._penalty()
                raise
            return await behavior(request, context)

        return call

    def _stream(self, behavior: Any) -> Any:
        async def call(request: Any, context: Context) -> AsyncIterator[Any]:
            peer = context.peer()
            try:
                self._admission.request(peer)
                close = self._admission.open_stream(peer)
            except TooMuchError:
                await self._penalty()
                raise
            try:
                async for response in behavior(request, context):
                    yield response
            finally:
                close()

        return call

    async def _penalty(self) -> None:
        if self._waiting >= _MOST_WAITING:
            return
        self._waiting += 1
        try:
            await asyncio.sleep(self._admission.refusal_in_s())
        finally:
            self._waiting -= 1
