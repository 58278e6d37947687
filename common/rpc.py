"""What every gRPC server of the project shares: its limits, and how a domain error becomes a status code.

common.bind binds what `new_server` makes to a TCP port or a Unix socket.
"""

import logging
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import grpc

from common import request_id
from common.error_details import metadata_of, metadata_of_defect
from common.errors import (
    DomainError,
    InvalidRequestError,
    NotAllowedError,
    NotAuthenticatedError,
    NotNowError,
    TooMuchError,
    UnknownServiceError,
)

if TYPE_CHECKING:
    Handler: TypeAlias = grpc.RpcMethodHandler[Any, Any]
    Context: TypeAlias = grpc.aio.ServicerContext[Any, Any]
else:
    # grpc's classes are generic in its stubs only.
    Handler, Context = grpc.RpcMethodHandler, grpc.aio.ServicerContext

Observe: TypeAlias = Callable[[str, grpc.StatusCode, float], None]
"""Told of every call that ends: the method's full name, the code, how many seconds it took."""

_log = logging.getLogger(__name__)

STATUS_CODES: Final[Mapping[type[DomainError], grpc.StatusCode]] = {
    InvalidRequestError: grpc.StatusCode.INVALID_ARGUMENT,
    NotNowError: grpc.StatusCode.FAILED_PRECONDITION,
    NotAuthenticatedError: grpc.StatusCode.UNAUTHENTICATED,
    NotAllowedError: grpc.StatusCode.PERMISSION_DENIED,
    TooMuchError: grpc.StatusCode.RESOURCE_EXHAUSTED,
    UnknownServiceError: grpc.StatusCode.NOT_FOUND,
}
"""Total: a test walks the subclasses of DomainError. Every other exception is a defect, so INTERNAL."""

STOP_GRACE_S: Final = 0.5
"""How long a server lets running calls finish when it stops."""

_SERVER_OPTIONS: Final = (
    # A second program on the same port is an error, never half of the calls.
    ("grpc.so_reuseport", 0),
    # Requests are small; nobody fills the robot's memory through this door.
    ("grpc.max_receive_message_length", 256 * 1024),
    ("grpc.max_send_message_length", 4 * 1024 * 1024),
    # On one connection at once. Without a limit, one that begins calls and takes them back at once crowds out
    # the others: when 1000 calls wait to be looked at, gRPC turns away whatever comes next.
    ("grpc.max_concurrent_streams", 256),
    # From the connection to the first whole word.
    ("grpc.server_handshake_timeout_ms", 5_000),
    # A peer that left without a word is noticed after 5 + 3 s.
    ("grpc.keepalive_time_ms", 5_000),
    ("grpc.keepalive_timeout_ms", 3_000),
    # Without this one gRPC 1.85 waits 60 s for any ping's answer, keepalive or not.
    ("grpc.http2.ping_timeout_ms", 3_000),
    ("grpc.keepalive_permit_without_calls", 1),
    # Clients may look more often themselves (ours every 2 s) without being sent away.
    ("grpc.http2.min_ping_interval_without_data_ms", 1_000),
)
_DEFECT: Final = "internal error; the robot's log says more"
_LEFT: Final = grpc.StatusCode.CANCELLED
"""How a call ends whose caller leaves before the answer."""
_MAX_CONCURRENT_CALLS: Final = 4096
"""More at once, of all connections, are refused with RESOURCE_EXHAUSTED. (Beyond a connection's own limit
HTTP/2 resets streams, which a flooding caller may see as UNAVAILABLE.)"""


def unobserved(_method: str, _code: grpc.StatusCode, _seconds: float) -> None:
    """Nobody counts."""


def new_server(
    interceptors: Sequence[grpc.aio.ServerInterceptor] = (), observe: Observe = unobserved
) -> grpc.aio.Server:
    """A server with the project's limits that answers domain errors with their codes.

    Args:
        interceptors: more of them, innermost last; they see domain errors before these become codes.
        observe: told of every call that ends.
    """
    return grpc.aio.server(
        interceptors=(ErrorInterceptor(observe), *interceptors),
        options=_SERVER_OPTIONS,
        maximum_concurrent_rpcs=_MAX_CONCURRENT_CALLS,
    )


class ErrorInterceptor(grpc.aio.ServerInterceptor):
    """Ends a call whose handler raised with the code of STATUS_CODES and the error's own words.

    An exception that is no DomainError is a defect of ours: it is logged whole, and the caller learns
    nothing but that.
    """

    def __init__(self, observe: Observe = unobserved) -> None:
        self._observe = observe
        # One entry per method that exists, so the wrapping is paid once, not per call.
        self._guarded: dict[str, Handler] = {}

    async def intercept_service(
        self,
        continuation: Callable[[grpc.HandlerCallDetails], Awaitable[Handler | None]],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> Handler | None:
        """Wraps the method's handler."""
        method = handler_call_details.method
        if method not in self._guarded:
            handler = await continuation(handler_call_details)
            if handler is None:
                return None
            self._guarded[method] = _guarded(handler, method, self._observe)
        return self._guarded[method]


def _guarded(handler: Handler, method: str, observe: Observe) -> Handler:
    return rewrapped(
        handler,
        lambda behavior: _guarded_unary(behavior, method, observe),
        lambda behavior: _guarded_stream(behavior, method, observe),
    )


def rewrapped(handler: Handler, unary: Callable[[Any], Any], stream: Callable[[Any], Any]) -> Handler:
    """The same handler with another behavior.

    Args:
        handler: of any method that has one request, or (reflection) streams both ways.
        unary: makes the new behavior of one with a single response.
        stream: the same for one whose responses are a stream.
    """
    serializers = handler.request_deserializer, handler.response_serializer
    if handler.unary_unary:
        return grpc.unary_unary_rpc_method_handler(unary(handler.unary_unary), *serializers)
    if handler.unary_stream:
        return grpc.unary_stream_rpc_method_handler(stream(handler.unary_stream), *serializers)
    if handler.stream_stream:
        return grpc.stream_stream_rpc_method_handler(stream(handler.stream_stream), *serializers)
    raise TypeError("no method has a stream of requests and one response")


def _guarded_unary(behavior: Any, method: str, observe: Observe) -> Any:
    async def call(request: Any, context: Context) -> Any:
        request_id.begin(context)
        began_s, code = time.perf_counter(), _LEFT
        try:
            reply = await behavior(request, context)
            code = grpc.StatusCode.OK
        except Exception as error:  # noqa: BLE001  # the border: whatever it is, the caller gets a code
            code = _code_of(error, context)
            await _end(context, error, method)
        else:
            return reply
        finally:
            observe(method, code, time.perf_counter() - began_s)

    return call


def _guarded_stream(behavior: Any, method: str, observe: Observe) -> Any:
    async def call(request: Any, context: Context) -> AsyncIterator[Any]:
        request_id.begin(context)
        began_s, code = time.perf_counter(), _LEFT
        try:
            async for response in behavior(request, context):
                yield response
            code = grpc.StatusCode.OK
        except Exception as error:  # noqa: BLE001  # the border: whatever it is, the caller gets a code
            code = _code_of(error, context)
            await _end(context, error, method)
        finally:
            observe(method, code, time.perf_counter() - began_s)

    return call


def _code_of(error: Exception, context: Context) -> grpc.StatusCode:
    """What the caller gets for it."""
    if isinstance(error, grpc.aio.AbortError):
        return context.code()
    if isinstance(error, DomainError):
        return STATUS_CODES.get(type(error), grpc.StatusCode.INTERNAL)
    return grpc.StatusCode.INTERNAL


async def _end(context: Context, error: Exception, method: str) -> None:
    """Raises grpc's own AbortError, always."""
    if isinstance(error, grpc.aio.AbortError):
        raise error
    code = _code_of(error, context)
    if isinstance(error, DomainError) and code is not grpc.StatusCode.INTERNAL:
        await context.abort(code, str(error), trailing_metadata=metadata_of(error, code))
    else:
        _log.error("%s failed", method, exc_info=error)
        await context.abort(code, _DEFECT, trailing_metadata=metadata_of_defect(_DEFECT))
