import asyncio
import resource
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import grpc
import pytest

import gateway.app  # noqa: F401  # so that every domain error that exists is known here
from common import rpc
from common.bind import bind_tcp, bind_unix
from common.errors import DomainError, InvalidRequestError, SpecificError
from common.grpc_errors import STATUS_CODES
from common.rpc import new_server
from tests.support.eventually import eventually


def below(error: type[DomainError]) -> Iterator[type[DomainError]]:
    for child in error.__subclasses__():
        yield child
        yield from below(child)


def test_every_domain_error_has_a_code() -> None:
    assert set(STATUS_CODES) == set(below(DomainError)) - {SpecificError}, (
        "of that only subclasses are raised"
    )


async def answers(error: Exception | None, *, stream: bool = False) -> Any:
    """What a caller sees of a handler that raises `error`, over a real connection."""

    async def unary(_request: bytes, _context: Any) -> bytes:
        if error:
            raise error
        return b"done"

    async def streaming(_request: bytes, _context: Any) -> Any:
        yield b"first"
        if error:
            raise error

    handlers: dict[str, grpc.RpcMethodHandler[bytes, bytes]] = {
        "Unary": grpc.unary_unary_rpc_method_handler(unary),
        "Stream": grpc.unary_stream_rpc_method_handler(streaming),
    }
    server = new_server()
    server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler("test.Service", handlers),))
    port = server.add_insecure_port("127.0.0.1:0")
    await server.start()
    try:
        async with grpc.aio.insecure_channel(f"127.0.0.1:{port}") as channel:
            if stream:
                streamed: grpc.aio.UnaryStreamMultiCallable[bytes, bytes] = channel.unary_stream(
                    "/test.Service/Stream"
                )
                return [each async for each in streamed(b"")]
            once: grpc.aio.UnaryUnaryMultiCallable[bytes, bytes] = channel.unary_unary("/test.Service/Unary")
            return await once(b"")
    finally:
        await server.stop(None)


async def test_a_handler_that_works_is_not_in_the_way() -> None:
    assert await answers(None) == b"done"
    assert await answers(None, stream=True) == [b"first"]


@pytest.mark.parametrize("stream", [False, True])
async def test_a_domain_error_arrives_with_its_code_and_words(stream: bool) -> None:
    with pytest.raises(grpc.aio.AioRpcError) as seen:
        await answers(InvalidRequestError("no such thing; choose another"), stream=stream)
    assert seen.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert seen.value.details() == "no such thing; choose another"


@pytest.mark.parametrize("stream", [False, True])
async def test_a_defect_is_in_the_log_whole_and_in_no_answer(
    stream: bool, caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(grpc.aio.AioRpcError) as seen:
        await answers(ZeroDivisionError("secret"), stream=stream)
    assert seen.value.code() is grpc.StatusCode.INTERNAL
    assert "secret" not in str(seen.value.details())
    assert "secret" in caplog.text


async def test_an_unknown_method_is_unimplemented() -> None:
    server = new_server()
    port = server.add_insecure_port("127.0.0.1:0")
    await server.start()
    try:
        async with grpc.aio.insecure_channel(f"127.0.0.1:{port}") as channel:
            nothing: grpc.aio.UnaryUnaryMultiCallable[bytes, bytes] = channel.unary_unary(
                "/test.Service/Nothing"
            )
            with pytest.raises(grpc.aio.AioRpcError) as seen:
                await nothing(b"")
            assert seen.value.code() is grpc.StatusCode.UNIMPLEMENTED
    finally:
        await server.stop(None)


def is_open(connection: socket.socket) -> bool:
    """Whether the server has sent something, as it does at first, and not closed."""
    connection.settimeout(5)
    try:
        return connection.recv(1) != b""
    except ConnectionError:
        return False


async def test_connections_beyond_the_limit_are_closed_and_each_address_has_its_own(tmp_path: Path) -> None:
    server = new_server(max_connections=2)
    port = bind_tcp(server, "127.0.0.1", 0)
    bind_unix(server, tmp_path / "socket")
    await server.start()
    try:
        with ExitStack() as stack:

            def connected() -> socket.socket:
                return stack.enter_context(socket.create_connection(("127.0.0.1", port)))

            first, second, third = connected(), connected(), connected()
            opened = [await asyncio.to_thread(is_open, each) for each in (first, second, third)]
            assert opened == [True, True, False]
            with socket.socket(socket.AF_UNIX) as local:
                local.connect(str(tmp_path / "socket"))
                assert await asyncio.to_thread(is_open, local)
            first.close()

            async def admitted() -> bool:
                return await asyncio.to_thread(is_open, connected())

            await eventually(admitted, bool, "there is room again")
    finally:
        await server.stop(None)


async def test_a_quiet_connection_is_closed_in_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    options = dict(rpc._SERVER_OPTIONS)  # five minutes are too long for a test
    assert options["grpc.max_connection_idle_ms"] == 300_000
    options["grpc.max_connection_idle_ms"] = 300
    monkeypatch.setattr(rpc, "_SERVER_OPTIONS", tuple(options.items()))
    server = new_server()
    port = server.add_insecure_port("127.0.0.1:0")
    await server.start()
    try:
        async with grpc.aio.insecure_channel(f"127.0.0.1:{port}") as channel:
            await channel.channel_ready()
            await asyncio.wait_for(channel.wait_for_state_change(grpc.ChannelConnectivity.READY), 5)
    finally:
        await server.stop(None)


def test_connections_leave_descriptors_for_the_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _which: (400, 400))
    assert rpc.possible_connections(1000) == 200
    assert rpc.possible_connections(100) == 100
    assert rpc.possible_connections(1000, addresses=2) == 100, "both together no more than one"
    monkeypatch.setattr(resource, "getrlimit", lambda _which: (resource.RLIM_INFINITY, 0))
    assert rpc.possible_connections(1000) == 1000
