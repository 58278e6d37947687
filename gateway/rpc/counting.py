"""Every call of the contract is counted, also those that the guard or the limits turn away."""

from collections.abc import Awaitable, Callable, Iterable

import grpc

from common.rpc import Handler, rewrapped
from gateway.rpc.tally import Tally


class CountingInterceptor(grpc.aio.ServerInterceptor):
    """Belongs to one event loop. Outside of the interceptors whose refusals count.

    Args:
        tally: keeps the counts.
        service: whose methods are counted; those of others are not.
        methods: their names.
    """

    def __init__(self, tally: Tally, service: str, methods: Iterable[str]) -> None:
        self._tally = tally
        self._names = {f"/{service}/{name}": name for name in methods}
        tally.expect(self._names.values())

    async def intercept_service(
        self,
        continuation: Callable[[grpc.HandlerCallDetails], Awaitable[Handler | None]],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> Handler | None:
        """Wraps the method's handler; asked once per method."""
        handler = await continuation(handler_call_details)
        name = self._names.get(handler_call_details.method)
        if handler is None or name is None:
            return handler
        return rewrapped(
            handler,
            lambda behavior: self._tally.counted(name, behavior),
            lambda behavior: self._tally.counted_stream(name, behavior),
        )
