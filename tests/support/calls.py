"""Calls of operators without a server: gRPC's context is a double, everything else is real."""

import asyncio
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import grpc

from common.interceptors import Chain, Interceptor
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import CONTRACT, Method

SENDING_TURNS = 20
"""Of the event loop, until a status has been sent."""
PEER = "ipv4:10.0.0.5:41234"


class RpcDouble:
    """gRPC's context, as far as interceptors look at it."""

    def __init__(self, peer: str, token: str | None, request: Any = b"") -> None:
        self._peer = peer
        self._token = token
        self._request = request
        self.aborted_with: grpc.StatusCode | None = None
        self.written: list[Any] = []
        """The responses of a stream."""

    async def read(self) -> Any:
        return self._request

    async def write(self, response: Any) -> None:
        self.written.append(response)

    def peer(self) -> str:
        return self._peer

    def invocation_metadata(self) -> tuple[tuple[str, str], ...]:
        return () if self._token is None else (("authorization", f"Bearer {self._token}"),)

    def time_remaining(self) -> None:
        return None

    def code(self) -> grpc.StatusCode | None:
        return self.aborted_with

    async def abort(self, code: grpc.StatusCode, details: str = "", trailing_metadata: Any = ()) -> None:  # noqa: ARG002
        if self.aborted_with is not None:
            raise grpc.aio.UsageError("Abort already called!")
        self.aborted_with = code
        for _ in range(SENDING_TURNS):
            await asyncio.sleep(0)
        raise grpc.aio.AbortError(details)


def call_of(
    method: str = "Ping",
    peer: str = PEER,
    token: str | None = None,
    *,
    streaming: bool = False,
    request_streaming: bool = False,
    service: str = CONTRACT.full_name,
) -> CallContext:
    rpc: Any = RpcDouble(peer, token)
    path = f"/{service}/{method}"
    described = Method(path, request_streaming=request_streaming, response_streaming=streaming)
    return CallContext(described, rpc)


async def serve(
    interceptors: Sequence[Interceptor[Any]],
    method: str,
    behavior: Any,
    request: Any = b"",
    *,
    peer: str = PEER,
    token: str | None = None,
) -> Any:
    """What a caller gets: the response, or those of a stream; raises what the call ended with."""
    chain = Chain(interceptors, Method, CallContext)
    handlers: Any = chain.service(CONTRACT, {method: behavior})
    details: Any = SimpleNamespace(method=f"/{CONTRACT.full_name}/{method}")
    handler: Any = handlers.service(details)
    rpc = RpcDouble(peer, token, request)
    if handler.response_streaming:
        await handler.stream_stream(None, rpc)
        return rpc.written
    return await handler.stream_unary(None, rpc)
