"""The chain: every hook in its order, for all four kinds of method, whatever one of them does."""

import asyncio
import gc
import logging
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

import grpc
import pytest

from common.errors import InvalidRequestError
from common.grpc_errors import ErrorInterceptor
from common.interceptors import Call, Chain, Interceptor, Method
from common.rpc import new_server

KINDS = {
    "Unary": (grpc.unary_unary_rpc_method_handler, "unary_unary"),
    "Responses": (grpc.unary_stream_rpc_method_handler, "unary_stream"),
    "Requests": (grpc.stream_unary_rpc_method_handler, "stream_unary"),
    "Both": (grpc.stream_stream_rpc_method_handler, "stream_stream"),
}


class Recorder(Interceptor[Call]):
    """Writes down what it is called for."""

    def __init__(self, name: str, steps: list[str]) -> None:
        self.name, self.steps = name, steps

    def on_call(self, _call: Call) -> None:
        self.steps.append(f"{self.name} call")

    def on_request(self, _call: Call, request: Any) -> Any:
        self.steps.append(f"{self.name} {request.decode()}")
        return request + self.name.encode()

    def on_response(self, _call: Call, response: Any) -> None:
        self.steps.append(f"{self.name} {response.decode()}")

    def on_end(self, _call: Call, error: BaseException | None) -> None:
        self.steps.append(f"{self.name} end" + (f" {type(error).__name__}" if error else ""))


async def once(_request: Any, _context: Any) -> bytes:
    return b"response"


async def often(_request: Any, _context: Any) -> AsyncIterator[bytes]:
    yield b"response"


async def once_for_many(requests: Any, _context: Any) -> bytes:
    return b"+".join([each async for each in requests])


async def often_for_many(requests: Any, _context: Any) -> AsyncIterator[bytes]:
    async for each in requests:
        yield each


BEHAVIORS: dict[str, Any] = {
    "Unary": once,
    "Responses": often,
    "Requests": once_for_many,
    "Both": often_for_many,
}


@asynccontextmanager
async def served(chain: Chain, handlers: dict[str, "grpc.RpcMethodHandler[Any, Any]"]) -> AsyncIterator[Any]:
    """A real connection to a server of test.Service with these methods."""
    server = new_server(chain)
    server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler("test.Service", handlers),))
    port = server.add_insecure_port("127.0.0.1:0")
    await server.start()
    try:
        async with grpc.aio.insecure_channel(f"127.0.0.1:{port}") as channel:
            yield channel
    finally:
        await server.stop(None)


async def called(chain: Chain, kind: str, *requests: bytes) -> list[bytes]:
    """What a caller gets over a real connection."""
    make, name = KINDS[kind]
    async with served(chain, {kind: make(BEHAVIORS[kind])}) as channel:
        call: Any = getattr(channel, name)(f"/test.Service/{kind}")
        request: Any = iter(requests) if kind in {"Requests", "Both"} else requests[0]
        if kind in {"Unary", "Requests"}:
            return [await call(request)]
        return [each async for each in call(request)]


async def test_hooks_run_in_order_and_may_replace_requests() -> None:
    steps: list[str] = []
    chain = Chain([ErrorInterceptor(), Recorder("a", steps), Recorder("b", steps)])
    assert await called(chain, "Unary", b"q") == [b"response"]
    assert steps == ["a call", "b call", "a q", "b qa", "b response", "a response", "b end", "a end"]


@pytest.mark.parametrize("kind", ["Requests", "Both"])
async def test_every_message_of_a_stream_passes(kind: str) -> None:
    steps: list[str] = []
    chain = Chain([ErrorInterceptor(), Recorder("a", steps)])
    responses = await called(chain, kind, b"1", b"2")
    assert b"+".join(responses) == b"1a+2a"
    assert [each for each in steps if each in {"a 1", "a 2"}] == ["a 1", "a 2"]
    assert steps[-1] == "a end"


@pytest.mark.parametrize("kind", ["Requests", "Both"])
async def test_a_caller_that_leaves_a_stream_of_requests_has_not_finished_it(kind: str) -> None:
    ended: asyncio.Future[BaseException | None] = asyncio.get_running_loop().create_future()

    class Ending(Interceptor[Call]):
        def on_end(self, _call: Call, error: BaseException | None) -> None:
            ended.set_result(error)

    make, name = KINDS[kind]
    async with served(Chain([ErrorInterceptor(), Ending()]), {kind: make(BEHAVIORS[kind])}) as channel:
        call: Any = getattr(channel, name)(f"/test.Service/{kind}")()
        await call.write(b"1")
        call.cancel()
        error = await asyncio.wait_for(ended, 10)
        assert isinstance(error, asyncio.CancelledError), repr(error)


class Refusing(Interceptor[Call]):
    def on_call(self, _call: Call) -> None:
        raise InvalidRequestError("not like this")


@pytest.fixture
def no_garbage_collection() -> Iterator[None]:
    """Leaves alone what only the cyclic collector would free."""
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("no_garbage_collection")
async def test_a_caller_that_leaves_while_a_response_is_on_its_way_ends_the_handler() -> None:
    """One that does not read: the handler is at its yield, and gRPC cancels the write, not the handler."""
    writing, ended = asyncio.Event(), asyncio.Event()
    endings: list[BaseException | None] = []

    class Ending(Interceptor[Call]):
        def on_end(self, _call: Call, error: BaseException | None) -> None:
            endings.append(error)

    async def many(_request: Any, _context: Any) -> AsyncIterator[bytes]:
        try:
            while True:
                writing.set()
                yield bytes(1 << 20)
        finally:
            # A generator must not need the loop's help to be closed.
            await asyncio.sleep(0)
            ended.set()

    handler: grpc.RpcMethodHandler[bytes, bytes] = grpc.unary_stream_rpc_method_handler(many)
    async with served(Chain([ErrorInterceptor(), Ending()]), {"Many": handler}) as channel:
        call = channel.unary_stream("/test.Service/Many")(b"")
        await asyncio.wait_for(writing.wait(), 5)
        await call.initial_metadata()
        call.cancel()
        await asyncio.wait_for(ended.wait(), 5)
    assert [type(each) for each in endings] == [asyncio.CancelledError]


async def test_a_response_that_can_not_be_written_is_a_caller_that_has_left() -> None:
    class Gone:
        async def read(self) -> bytes:
            return b"q"

        async def write(self, _response: bytes) -> None:
            raise grpc.aio.InternalError("Failed grpc_call_start_batch")

        def invocation_metadata(self) -> tuple[()]:
            return ()

    steps: list[str] = []
    chain = Chain([Recorder("a", steps)])
    wrapped: grpc.RpcMethodHandler[bytes, bytes] = grpc.unary_stream_rpc_method_handler(often)
    details: Any = SimpleNamespace(method="/test.Service/Responses")

    async def found(_details: Any) -> Any:
        return wrapped

    handler = await chain.intercept_service(found, details)
    assert handler is not None
    respond: Any = handler.stream_stream
    with pytest.raises(asyncio.CancelledError):
        await respond(None, Gone())
    assert steps == ["a call", "a q", "a response", "a end CancelledError"]


async def test_a_refusal_ends_what_has_begun_and_nothing_else() -> None:
    steps: list[str] = []
    chain = Chain([ErrorInterceptor(), Recorder("a", steps), Refusing(), Recorder("b", steps)])
    with pytest.raises(grpc.aio.AioRpcError) as seen:
        await called(chain, "Unary", b"q")
    assert seen.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert steps == ["a call", "a end InvalidRequestError"]


class Failing(Interceptor[Call]):
    def on_end(self, _call: Call, _error: BaseException | None) -> None:
        raise ZeroDivisionError("secret")


@pytest.mark.parametrize("kind", ["Unary", "Responses"])
async def test_a_hook_that_fails_at_the_end_keeps_no_other_from_ending(
    kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    steps: list[str] = []
    chain = Chain([ErrorInterceptor(), Recorder("a", steps), Failing()])
    with caplog.at_level(logging.ERROR):
        assert await called(chain, kind, b"q") == [b"response"]
    assert steps[-1] == "a end"
    assert "Failing.on_end failed" in caplog.text


@asynccontextmanager
async def withholding(chain: Chain, kind: str) -> AsyncIterator[Any]:
    """A call of a method with one request of which nothing but the headers has been sent."""
    make, _ = KINDS[kind]
    async with served(chain, {kind: make(BEHAVIORS[kind])}) as channel:
        method: Any = channel.stream_unary if kind == "Unary" else channel.stream_stream
        yield method(f"/test.Service/{kind}")()


@pytest.mark.parametrize("kind", ["Unary", "Responses"])
async def test_a_call_is_refused_by_its_headers(kind: str) -> None:
    async with withholding(Chain([ErrorInterceptor(), Refusing()]), kind) as call:
        assert await asyncio.wait_for(call.code(), 5) is grpc.StatusCode.INVALID_ARGUMENT
        assert "not like this" in await call.details()


@pytest.mark.parametrize("kind", ["Unary", "Responses"])
async def test_a_request_that_does_not_come_ends_its_call(kind: str) -> None:
    steps: list[str] = []
    chain = Chain([ErrorInterceptor(), Recorder("a", steps)], request_within_s=0.2)
    async with withholding(chain, kind) as call:
        assert await asyncio.wait_for(call.code(), 5) is grpc.StatusCode.INVALID_ARGUMENT
        assert "no request within 0.2 s" in await call.details()
    assert steps == ["a call", "a end InvalidRequestError"]


@pytest.mark.parametrize("kind", ["Unary", "Responses"])
async def test_a_call_that_ends_without_its_request_is_refused(kind: str) -> None:
    async with withholding(Chain([ErrorInterceptor()]), kind) as call:
        await call.done_writing()
        assert await asyncio.wait_for(call.code(), 5) is grpc.StatusCode.INVALID_ARGUMENT
        assert "ended without a request" in await call.details()


async def test_a_caller_that_leaves_before_its_request_has_made_none() -> None:
    ended: asyncio.Future[BaseException | None] = asyncio.get_running_loop().create_future()
    arrived = asyncio.Event()

    class Ending(Interceptor[Call]):
        def on_call(self, _call: Call) -> None:
            arrived.set()

        def on_end(self, _call: Call, error: BaseException | None) -> None:
            ended.set_result(error)

    async with withholding(Chain([ErrorInterceptor(), Ending()]), "Unary") as call:
        await asyncio.wait_for(arrived.wait(), 5)
        call.cancel()
        error = await asyncio.wait_for(ended, 5)
    assert isinstance(error, asyncio.CancelledError), repr(error)


class NotForThis(Recorder):
    def applies_to(self, method: Method) -> bool:
        return method.streaming


async def test_an_interceptor_that_does_not_apply_is_not_called() -> None:
    steps: list[str] = []
    chain = Chain([ErrorInterceptor(), NotForThis("a", steps)])
    await called(chain, "Unary", b"q")
    assert steps == []
    await called(chain, "Responses", b"q")
    assert steps
