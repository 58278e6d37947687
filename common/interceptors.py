"""Interceptors: aspects that every call of a server passes before, while and after its handler runs.

grpc.aio wraps handlers, and a handler has one of four kinds: written against that interface, each aspect is
four nested functions. Here an aspect is an `Interceptor` with hooks, and one `Chain` calls the hooks for all
four kinds:

    applies_to   once per method: whether the interceptor takes part in its calls
    on_call      first to last, when the headers of a call arrive; refuses by raising
    on_request   first to last, for each message of the caller; may replace it, and refuses by raising
    (handler)
    on_response  last to first, for each message of the handler
    on_end       last to first, once, for those whose on_call returned
    on_error     after on_end, the same ones, if the call failed; what it raises is what the caller gets

A call is judged by its headers: gRPC would not run the handler of a method with one request before that has
arrived, so a caller that withholds it would keep a place that no interceptor knows of. The chain serves each
method as one with a stream of requests, which makes no difference on the wire, and reads the one request
itself, within a bound.

What a call does not need must cost it next to nothing: a poll of the status takes 200 us on a desktop's core,
and each coroutine or wrapper more would be paid some thousand times a second.
"""

import asyncio
import logging
import time
from collections.abc import AsyncIterable, AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import aclosing
from typing import TYPE_CHECKING, Any, Final, Generic, TypeAlias, TypeVar

import grpc
from google.protobuf.descriptor import ServiceDescriptor
from google.protobuf.message import Message

from common import request_id
from common.errors import InvalidRequestError

if TYPE_CHECKING:
    Handler: TypeAlias = grpc.RpcMethodHandler[Any, Any]
    RpcContext: TypeAlias = grpc.aio.ServicerContext[Any, Any]
else:
    # grpc's classes are generic in its stubs only.
    Handler, RpcContext = grpc.RpcMethodHandler, grpc.aio.ServicerContext

_log = logging.getLogger(__name__)

_CANCELLATION_GRACE_S: Final = 0.1
"""When a caller leaves, gRPC ends the iterator of its requests as after the last one, or fails to write a
response, and cancels the task afterwards, mostly within a millisecond."""
REQUEST_WITHIN_S: Final = 10.0
"""From the admission of a call to the last byte of its only request: the 256 KiB that a server accepts at
most (common/rpc.py), at 210 kbit/s."""

Behavior: TypeAlias = Callable[[Any, Any], Any]
"""A method of a servicer: one request, or an iterator of them, and the call; one response, or a generator."""


class Method:
    """One method of a service.

    Attributes:
        path: on the wire, "/package.Service/Method".
        request_streaming: whether requests are a stream.
        streaming: whether requests or responses are.
    """

    def __init__(
        self, path: str, *, request_streaming: bool = False, response_streaming: bool = False
    ) -> None:
        self.path = path
        self.request_streaming = request_streaming
        self.streaming = request_streaming or response_streaming


class Call:
    """One call while it is served.

    Attributes:
        method: what was called.
        rpc: gRPC's own context.
        began_s: when it arrived, by `time.perf_counter`.
    """

    __slots__ = ("began_s", "method", "rpc")

    def __init__(self, method: Any, rpc: RpcContext) -> None:
        self.method = method
        self.rpc = rpc
        self.began_s = time.perf_counter()


CallT_contra = TypeVar("CallT_contra", bound=Call, contravariant=True)


class Interceptor(Generic[CallT_contra]):
    """One aspect of calls; overrides the hooks it needs. Used on the server's event loop alone."""

    def applies_to(self, method: Any) -> bool:  # noqa: ARG002  # for overriders
        """Returns whether calls of this method pass here."""
        return True

    def on_call(self, call: CallT_contra) -> Awaitable[None] | None:
        """Called when a call arrives; raises to refuse it. Returns an awaitable only if it must wait."""

    def on_request(self, call: CallT_contra, request: Any) -> Any:  # noqa: ARG002  # for overriders
        """Called for each message of the caller; returns it or another in its place, or raises."""
        return request

    def on_response(self, call: CallT_contra, response: Any) -> None:
        """Called for each message of the handler before it leaves; raises to withhold it."""

    def on_end(self, call: CallT_contra, error: BaseException | None) -> None:
        """Called when the call has ended: `error` is None, or what the handler or another hook raised.

        A caller that leaves ends its call with `asyncio.CancelledError`.
        What this hook raises is logged, and the others are called all the same: each gives back what it took.
        """

    async def on_error(self, call: CallT_contra, error: BaseException) -> None:
        """Called when the call has failed; may raise what the caller gets. Later ones are not called then."""


class Chain(grpc.aio.ServerInterceptor):
    """Passes every call of a server through its interceptors.

    Args:
        interceptors: outermost first.
        method_type: describes a method by path, `request_streaming` and `response_streaming`.
        call_type: stands for one call; made of its method and gRPC's context.
        request_within_s: how long a call that was admitted may withhold its only request.

    Attributes:
        interceptors: in their order.
    """

    def __init__(
        self,
        interceptors: Sequence[Interceptor[Any]],
        method_type: Callable[..., Any] = Method,
        call_type: Callable[[Any, RpcContext], Any] = Call,
        request_within_s: float = REQUEST_WITHIN_S,
    ) -> None:
        self.interceptors: Final = tuple(interceptors)
        self._method_type = method_type
        self._call_type = call_type
        self._request_within_s = request_within_s
        self._wrapped: dict[str, Handler] = {}
        """By path; a handler is wrapped once, not per call."""

    def service(self, service: ServiceDescriptor, methods: Mapping[str, Behavior]) -> grpc.GenericRpcHandler:
        """Returns the handler of a service whose methods take the chain's call object.

        Requests reach the interceptors as bytes; responses may be messages or bytes.

        Args:
            service: of the schema.
            methods: by name.
        """
        handlers = {}
        for name, behavior in methods.items():
            method = service.methods_by_name[name]
            path = f"/{service.full_name}/{name}"
            handlers[name] = self._wrapped[path] = self._handler(
                path,
                behavior,
                request_streaming=method.client_streaming,
                response_streaming=method.server_streaming,
                serializer=_to_bytes,
            )
        return grpc.method_handlers_generic_handler(service.full_name, handlers)

    async def intercept_service(
        self,
        continuation: Callable[[grpc.HandlerCallDetails], Awaitable[Handler | None]],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> Handler | None:
        """Wraps the handlers of services that others wrote: they take gRPC's own context."""
        path = handler_call_details.method
        if path not in self._wrapped:
            handler = await continuation(handler_call_details)
            if handler is None:
                return None
            self._wrapped[path] = self._handler(
                path,
                _behavior_of(handler),
                request_streaming=handler.request_streaming,
                response_streaming=handler.response_streaming,
                deserializer=handler.request_deserializer,
                serializer=handler.response_serializer,
            )
        return self._wrapped[path]

    def _handler(
        self,
        path: str,
        behavior: Behavior,
        *,
        request_streaming: bool,
        response_streaming: bool,
        serializer: Callable[[Any], bytes] | None,
        deserializer: Callable[[bytes], Any] | None = None,
    ) -> Handler:
        method = self._method_type(
            path, request_streaming=request_streaming, response_streaming=response_streaming
        )
        passage = _Passage([each for each in self.interceptors if each.applies_to(method)])
        new_call, within_s = self._call_type, self._request_within_s

        async def requested(call: Any, requests: AsyncIterable[Any]) -> Any:
            if request_streaming:
                return passage.each_received(call, requests)
            return passage.received(call, await _only_request(call.rpc, within_s))

        async def respond_once(requests: AsyncIterable[Any], rpc: RpcContext) -> Any:
            call = new_call(method, rpc)
            entered: list[Interceptor[Any]] = []
            try:
                await passage.enter(call, entered)
                response = passage.sent(call, await behavior(await requested(call, requests), call))
            except BaseException as error:
                await passage.fail(call, entered, error)
                raise
            passage.end(call, entered, None)
            return response

        # Writes the responses itself. From a generator gRPC would write them, and when the caller leaves it
        # cancels that write alone: the generator, and with it the end of the call, is left to the collector.
        async def respond_often(requests: AsyncIterable[Any], rpc: RpcContext) -> None:
            call = new_call(method, rpc)
            entered: list[Interceptor[Any]] = []
            try:
                await passage.enter(call, entered)
                async with aclosing(behavior(await requested(call, requests), call)) as responses:
                    async for response in responses:
                        outgoing = passage.sent(call, response)
                        try:
                            await rpc.write(outgoing)
                        except grpc.aio.InternalError:
                            # The caller has left. A handler must not be cancelled again while it ends.
                            await asyncio.sleep(_CANCELLATION_GRACE_S)
                            raise asyncio.CancelledError from None
            except BaseException as error:
                await passage.fail(call, entered, error)
                raise
            passage.end(call, entered, None)

        if response_streaming:
            return grpc.stream_stream_rpc_method_handler(respond_often, deserializer, serializer)
        return grpc.stream_unary_rpc_method_handler(respond_once, deserializer, serializer)


class _Passage:
    """The hooks of the interceptors that apply to one method."""

    def __init__(self, interceptors: Sequence[Interceptor[Any]]) -> None:
        self._interceptors = interceptors
        self._on_request = [each.on_request for each in interceptors if _overrides(each, "on_request")]
        self._on_response = [
            each.on_response for each in interceptors[::-1] if _overrides(each, "on_response")
        ]

    async def enter(self, call: Call, entered: list[Interceptor[Any]]) -> None:
        """Calls `on_call`; `entered` gets the interceptors that have admitted the call."""
        request_id.begin(call.rpc)
        for each in self._interceptors:
            waiting = each.on_call(call)
            if waiting is not None:
                await waiting
            entered.append(each)

    async def each_received(self, call: Call, requests: AsyncIterable[Any]) -> AsyncIterator[Any]:
        async for request in requests:
            yield self.received(call, request)
        # Raises CancelledError if the caller has left.
        await asyncio.sleep(_CANCELLATION_GRACE_S)

    def received(self, call: Call, request: Any) -> Any:
        for on_request in self._on_request:
            request = on_request(call, request)
        return request

    def sent(self, call: Call, response: Any) -> Any:
        for on_response in self._on_response:
            on_response(call, response)
        return response

    def end(self, call: Call, entered: list[Interceptor[Any]], error: BaseException | None) -> None:
        for each in reversed(entered):
            try:
                each.on_end(call, error)
            except Exception:  # noqa: BLE001  # whatever it is: the outer ones give back what they took
                _log.exception("%s: %s.on_end failed", call.method.path, type(each).__name__)

    async def fail(self, call: Call, entered: list[Interceptor[Any]], error: BaseException) -> None:
        self.end(call, entered, error)
        for each in reversed(entered):
            await each.on_error(call, error)


async def _only_request(rpc: RpcContext, within_s: float) -> Any:
    """Returns the request of a method that takes one.

    Raises:
        InvalidRequestError: there is none within `within_s`, or at all.
    """
    try:
        async with asyncio.timeout(within_s):
            request = await rpc.read()
    except TimeoutError:
        text = f"the call had no request within {within_s:g} s of its headers; send it with them"
        raise InvalidRequestError(text) from None
    if request is grpc.aio.EOF:
        # Raises CancelledError if the caller has left.
        await asyncio.sleep(_CANCELLATION_GRACE_S)
        raise InvalidRequestError("the call ended without a request; this method takes one")
    return request


def _behavior_of(handler: Handler) -> Behavior:
    behavior = handler.unary_unary or handler.unary_stream or handler.stream_unary or handler.stream_stream
    assert behavior is not None, "a handler has one of four kinds"  # noqa: S101  # grpc's own
    return lambda request, call: behavior(request, call.rpc)


def _overrides(interceptor: Interceptor[Any], hook: str) -> bool:
    return getattr(type(interceptor), hook) is not getattr(Interceptor, hook)


def _to_bytes(response: Message | bytes) -> bytes:
    return response if isinstance(response, bytes) else response.SerializeToString()
