"""Calls and clients are counted, however a call ends."""

from typing import Any

import pytest

from common.errors import InvalidRequestError, TooMuchError
from common.interceptors import Interceptor
from common.reasons import Reason
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import CONTRACT, Method
from gateway.rpc.interceptors.stats import RECENT_S, Stats
from tests.support.calls import call_of, serve
from tests.support.clock import Clock


class Refusing(Interceptor[CallContext]):
    """One further in, that lets no call pass."""

    def on_call(self, _call: CallContext) -> None:
        raise TooMuchError("too often", Reason.TOO_MANY_REQUESTS)


async def ping(stats: Stats, peer: str = "ipv4:10.0.0.1:1", raises: type[Exception] | None = None) -> Any:
    async def behavior(_request: Any, _call: CallContext) -> bytes:
        if raises:
            raise raises
        return b"answer"

    return await serve([stats], "Ping", behavior, peer=peer)


def counts(stats: Stats, method: str) -> tuple[int, int, int]:
    counted = stats.contract[method]
    return counted.served, counted.refused, counted.failed


async def test_answers_refusals_and_failures_are_distinguished() -> None:
    stats = Stats(clock=Clock())
    assert await ping(stats) == b"answer"
    with pytest.raises(InvalidRequestError):
        await ping(stats, raises=InvalidRequestError)
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            await ping(stats, raises=ZeroDivisionError)
    assert counts(stats, "Ping") == (1, 1, 2)
    assert (stats.served, stats.refused) == (1, 1)
    assert stats.methods["Ping"].ended == {"OK": 1, "INVALID_ARGUMENT": 1, "INTERNAL": 2}
    assert stats.methods["Ping"].durations.cumulative()[-1] == ("+Inf", 4.0)


async def test_what_an_inner_interceptor_refuses_is_counted_and_makes_no_client() -> None:
    stats = Stats(clock=Clock())
    with pytest.raises(TooMuchError):
        await serve([stats, Refusing()], "Ping", None)
    assert counts(stats, "Ping") == (0, 1, 0)
    assert stats.client_count() == 0


async def test_methods_have_counts_before_their_first_call() -> None:
    stats = Stats(["Ping", "GetSystemStatus"])
    assert set(stats.contract) == {"Ping", "GetSystemStatus"}


async def test_methods_of_two_services_that_share_a_name_are_counted_apart() -> None:
    stats = Stats(clock=Clock())
    for path in ("/grpc.health.v1.Health/Watch", "/test.Lamp/Watch", f"/{CONTRACT.full_name}/Ping"):
        call = call_of()
        call.method = Method(path)
        stats.on_end(call, None)
    assert set(stats.methods) == {"grpc.health.v1.Health/Watch", "test.Lamp/Watch", "Ping"}


async def test_a_connection_is_a_client_while_it_calls() -> None:
    clock = Clock()
    stats = Stats(clock=clock)
    assert stats.client_count() == 0
    await ping(stats, "a")
    await ping(stats, "b")
    await ping(stats, "a")
    assert stats.client_count() == 2
    clock.now_s += RECENT_S / 2
    await ping(stats, "a")
    clock.now_s += RECENT_S * 0.6
    assert stats.client_count() == 1


async def test_a_flood_of_new_connections_takes_bounded_memory() -> None:
    stats = Stats(clock=Clock())
    for number in range(5000):
        await ping(stats, str(number))
    assert stats.client_count() == 1024


async def watch(stats: Stats, responses: int, raises: type[Exception] | None = None) -> Any:
    async def behavior(_request: Any, _call: CallContext) -> Any:
        for _ in range(responses):
            assert stats.contract["WatchSystemStatus"].open == 1
            yield b"answer"
        if raises:
            raise raises

    return await serve([stats], "WatchSystemStatus", behavior, peer="a")


async def test_a_stream_is_served_once_however_many_responses_it_has() -> None:
    stats = Stats(clock=Clock())
    assert await watch(stats, 3) == [b"answer"] * 3
    with pytest.raises(InvalidRequestError):
        await watch(stats, 0, raises=InvalidRequestError)
    with pytest.raises(ZeroDivisionError):
        await watch(stats, 0, raises=ZeroDivisionError)
    assert counts(stats, "WatchSystemStatus") == (1, 1, 1)
    assert stats.contract["WatchSystemStatus"].open == 0


async def test_a_connection_that_is_sent_something_is_a_client() -> None:
    clock = Clock()
    stats = Stats(clock=clock)

    async def behavior(_request: Any, _call: CallContext) -> Any:
        yield b"answer"
        assert stats.client_count() == 1
        clock.now_s += RECENT_S * 2
        assert stats.client_count() == 0
        yield b"answer"
        assert stats.client_count() == 1

    assert len(await serve([stats], "WatchSystemStatus", behavior, peer="a")) == 2
