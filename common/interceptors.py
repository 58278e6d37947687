"""Interceptors: aspects that every call of a server passes before, while and after its handler runs.

grpc.aio wraps handlers, and a handler has one of four kinds: written against that interface, each aspect is
four nested functions. Here an aspect is an `Interceptor` with hooks, and one `Chain` calls the hooks for
all four kinds:

    on_call      first to last, once per call; may wait, and refuses by raising
    on_request   first to last, for each message of the caller; may replace it, and refuses by raising
    (handler)
    on_response  last to first, for each message of the handler
    on_end       last to first, once, for those whose on_call returned
"""

import time
from collections.abc import AsyncIterable, AsyncIterator, Awaitable, Callable, Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, Generic, TypeAlias, TypeVar

import grpc
from google.protobuf.descriptor import ServiceDescriptor
from google.protobuf.message import Message

from common import request_id

if TYPE_CHECKING:
    Handler: TypeAlias = grpc.RpcMethodHandler[Any, Any]
    RpcContext: TypeAlias = grpc.aio.ServicerContext[Any, Any]
else:
    # grpc's classes are generic in its stubs only.
    Handler, RpcContext = grpc.RpcMethodHandler, grpc.aio.ServicerContext

Behavior: TypeAlias = Callable[[Any, Any], Any]
"""A method of a servicer: one request, or an iterator of them, and the call; one response, or an iterator."""


class Call:
    """One call while it is served.

    Attributes:
        path: the method's name on the wire, "/package.Service/Method".
        rpc: gRPC's own context.
        streaming: whether requests or responses are a stream.
        began_s: when it arrived, by `time.perf_counter`.
    """

    __slots__ = ("began_s", "path", "rpc", "streaming")

    def __init__(self, path: str, rpc: RpcContext, *, streaming: bool) -> None:
        self.path = path
        self.rpc = rpc
        self.streaming = streaming
        self.began_s = time.perf_counter()


CallT = TypeVar("CallT", bound=Call)
CallT_contra = TypeVar("CallT_contra", bound=Call, contravariant=True)


class Interceptor(Generic[CallT_contra]):
    """One aspect of every call; overrides the hooks it needs. Used on the server's event loop alone."""

    async def on_call(self, call: CallT_contra) -> None:
        """Called when a call arrives; raises to refuse it."""

    def on_request(self, call: CallT_contra, request: Any) -> Any:
        """Called for each message of the caller; returns it or another in its place, or raises."""
        return request

    def on_response(self, call: CallT_contra, response: Any) -> None:
        """Called for each message of the handler before it leaves; raises to withhold it."""

    async def on_end(self, call: CallT_contra, error: BaseException | None) -> None:
        """Called when the call has ended: `error` is None, or what the handler or another hook raised.

        A caller that leaves ends its call with `asyncio.CancelledError`, or a stream with `GeneratorExit`.
        """


class Chain(grpc.aio.ServerInterceptor, Generic[CallT]):
    """Passes every call of a server through its interceptors.

    Args:
        interceptors: outermost first.
        call_type: makes the object that stands for one call.
    """

    def __init__(self, interceptors: Sequence[Interceptor[CallT]], call_type: type[CallT]) -> None:
        self._interceptors: Final = tuple(interceptors)
        self._call_type = call_type
        # Only those that do something: an empty hook per message would cost more than the rest of the loop.
        self._on_request = [each.on_request for each in interceptors if _overrides(each, "on_request")]
        self._on_response = [
            each.on_response for each in interceptors[::-1] if _overrides(each, "on_response")
        ]
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
                _with_rpc_context(_behavior_of(handler)),
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
        streaming = request_streaming or response_streaming

        async def respond_once(request: Any, rpc: RpcContext) -> Any:
            call = self._call_type(path, rpc, streaming=streaming)
            async with _Passage(self._interceptors, call):
                response = await behavior(self._received(call, request, request_streaming), call)
                return self._sent(call, response)

        async def respond_often(request: Any, rpc: RpcContext) -> AsyncIterator[Any]:
            call = self._call_type(path, rpc, streaming=streaming)
            async with _Passage(self._interceptors, call):
                async for response in behavior(self._received(call, request, request_streaming), call):
                    yield self._sent(call, response)

        respond = respond_often if response_streaming else respond_once
        return _KINDS[request_streaming, response_streaming](respond, deserializer, serializer)

    def _received(self, call: CallT, request: Any, request_streaming: bool) -> Any:
        return self._each_received(call, request) if request_streaming else self._one_received(call, request)

    async def _each_received(self, call: CallT, requests: AsyncIterable[Any]) -> AsyncIterator[Any]:
        async for request in requests:
            yield self._one_received(call, request)

    def _one_received(self, call: CallT, request: Any) -> Any:
        for on_request in self._on_request:
            request = on_request(call, request)
        return request

    def _sent(self, call: CallT, response: Any) -> Any:
        for on_response in self._on_response:
            on_response(call, response)
        return response


class _Passage:
    """The time from a call's arrival to its end: `on_call` of all interceptors, then `on_end`."""

    __slots__ = ("_call", "_entered", "_interceptors")

    def __init__(self, interceptors: Sequence[Interceptor[Any]], call: Call) -> None:
        self._interceptors = interceptors
        self._call = call
        self._entered = 0

    async def __aenter__(self) -> None:
        call = self._call
        request_id.begin(call.rpc)
        try:
            for each in self._interceptors:
                await each.on_call(call)
                self._entered += 1
        except BaseException as error:
            await self._leave(error)
            raise

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._leave(error)

    async def _leave(self, error: BaseException | None) -> None:
        for each in reversed(self._interceptors[: self._entered]):
            await each.on_end(self._call, error)


_KINDS: Final[Mapping[tuple[bool, bool], Callable[..., Handler]]] = {
    (False, False): grpc.unary_unary_rpc_method_handler,
    (False, True): grpc.unary_stream_rpc_method_handler,
    (True, False): grpc.stream_unary_rpc_method_handler,
    (True, True): grpc.stream_stream_rpc_method_handler,
}
"""By whether requests, and whether responses, are a stream."""


def _behavior_of(handler: Handler) -> Behavior:
    behavior = handler.unary_unary or handler.unary_stream or handler.stream_unary or handler.stream_stream
    assert behavior is not None, "a handler has one of four kinds"
    return behavior


def _with_rpc_context(behavior: Behavior) -> Behavior:
    def adapted(request: Any, call: Call) -> Any:
        return behavior(request, call.rpc)

    return adapted


def _overrides(interceptor: Interceptor[Any], hook: str) -> bool:
    return getattr(type(interceptor), hook) is not getattr(Interceptor, hook)


def _to_bytes(response: Message | bytes) -> bytes:
    return response if isinstance(response, bytes) else response.SerializeToString()
