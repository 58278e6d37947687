"""Which server comes after one that was lost, and what need not wait for long once another one answers."""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from common.tasks import cancel
from fleet.connection import FleetAddress, Hub, Start
from fleet.errors import HubError, HubReason, RefusedError, UnreachableError
from tests.support.virtual_time import VirtualTimeLoop, in_virtual_time

_STEADY_S = 20.0
"""A connection that stood for so long was a success: there is no pause before the next one."""


class Opened:
    """A session with a server, until a test ends it."""

    def __init__(self, server: str) -> None:
        self.server = server
        self.lost: asyncio.Future[HubError] = asyncio.get_running_loop().create_future()

    async def close(self) -> None:
        """There is nothing to close."""


class Servers:
    """Servers that all answer at once.

    Attributes:
        sessions: that were opened so far.
    """

    def __init__(self) -> None:
        self.sessions: list[Opened] = []

    async def open(self, server: str, **_: Any) -> Opened:
        self.sessions.append(Opened(server))
        return self.sessions[-1]

    async def lose(self) -> None:
        """The newest session ends after it has stood for a while; returns when another one stands."""
        await asyncio.sleep(_STEADY_S)
        self.sessions[-1].lost.set_result(UnreachableError("stale connection"))
        await asyncio.sleep(_STEADY_S)


@pytest.fixture
def servers(monkeypatch: pytest.MonkeyPatch) -> Servers:
    found = Servers()
    monkeypatch.setattr("fleet.connection.Session", SimpleNamespace(open=found.open))
    monkeypatch.setattr("fleet.connection.random.shuffle", lambda _servers: None)
    return found


@asynccontextmanager
async def running(*servers: str) -> AsyncIterator[Hub]:
    hub = Hub(FleetAddress(servers))
    task = asyncio.create_task(hub.run())
    try:
        await hub.connected(1.0)
        yield hub
    finally:
        await cancel([task])


@in_virtual_time
async def test_the_server_that_was_lost_is_the_last_to_be_tried(servers: Servers) -> None:
    """One that is silent takes new connections, too: it would hold up the way to another one."""
    async with running("a", "b", "c") as hub:
        for _ in range(3):
            await servers.lose()
        assert [each.server for each in servers.sessions] == ["a", "b", "a", "b"]
        assert hub.link.server == "b"


@in_virtual_time
async def test_one_that_has_just_been_lost_is_no_connection(servers: Servers) -> None:
    """The defect: who repeated a call that fails without it never let the supervisor have its turn."""
    async with running("a", "b") as hub:
        servers.sessions[-1].lost.set_result(UnreachableError("stale connection"))
        with pytest.raises(UnreachableError, match="stale connection"):
            await hub.connected(0.1)
        await hub.connected()
        assert [each.server for each in servers.sessions] == ["a", "b"]


@in_virtual_time
async def test_the_only_server_is_tried_again(servers: Servers) -> None:
    async with running("a"):
        await servers.lose()
        assert [each.server for each in servers.sessions] == ["a", "a"]


@in_virtual_time
async def test_a_pause_ends_with_another_connection(servers: Servers) -> None:
    loop = asyncio.get_running_loop()
    async with running("a", "b") as hub:
        pausing = asyncio.create_task(hub.pause(1000.0))
        await servers.lose()
        assert pausing.done()
        begun_s = loop.time()
        await hub.pause(1000.0)
        assert loop.time() - begun_s == pytest.approx(1000.0)


@pytest.mark.parametrize("reading", ["direct.follow", "consuming.pull"])
@pytest.mark.parametrize(("after_s", "longest_s"), [(100.0, 1.0), (5.0, 60.0)])
@in_virtual_time
async def test_pauses_grow_with_failures_in_a_row_alone(
    servers: Servers, monkeypatch: pytest.MonkeyPatch, reading: str, after_s: float, longest_s: float
) -> None:
    """The defect: without a message between them, some failures in a month had a person look at the past."""
    loop = asyncio.get_running_loop()
    begun_s: list[float] = []
    failed_s: list[float] = []

    async def fails(*_: object) -> AsyncGenerator[None, None]:
        begun_s.append(loop.time())
        await asyncio.sleep(after_s)
        failed_s.append(loop.time())
        if failed_s:
            raise HubError(HubReason.TIMEOUT, "no answer")
        yield

    monkeypatch.setattr(f"fleet.connection.{reading}", fails)
    async with running("a") as hub:
        read: AsyncGenerator[object, None] = (
            hub.follow("stream", "subject", Start.all()) if "follow" in reading else hub.pull("stream", "r1")
        )
        task = asyncio.ensure_future(anext(read))
        await asyncio.sleep(12 * (after_s + longest_s))
        await cancel([task])
    assert len(servers.sessions) == 1
    pauses_s = [begun - failed for failed, begun in zip(failed_s, begun_s[1:], strict=False)]
    assert len(pauses_s) >= 10
    assert longest_s / 2 <= max(pauses_s) <= longest_s


_PATIENCE_S = 5.0
"""Of robotctl and of robot-bridge hub."""


@asynccontextmanager
async def refused(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Hub]:
    """A hub whose last server refuses, while the others are silent."""

    async def open_one(server: str, **_: Any) -> None:
        if server == "c":
            raise RefusedError("revoked")
        await asyncio.sleep(3600.0)

    monkeypatch.setattr("fleet.connection.Session", SimpleNamespace(open=open_one))
    monkeypatch.setattr("fleet.connection.random.shuffle", lambda _servers: None)
    hub = Hub(FleetAddress(("a", "b", "c")))
    task = asyncio.create_task(hub.run())
    try:
        yield hub
    finally:
        await cancel([task])


@pytest.mark.parametrize("once", [False, True])
@pytest.mark.parametrize("stands_still_s", [0.0, 1.0, 3.0])
@in_virtual_time
async def test_a_refusal_is_reported_also_after_a_stall(
    monkeypatch: pytest.MonkeyPatch, stands_still_s: float, once: bool
) -> None:
    """The defect: a caller's deadline could come before the end of the attempts, 0.25 s earlier."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    async with refused(monkeypatch) as hub:
        loop.call_at(4.7, loop.spend, stands_still_s)
        with pytest.raises(HubError, match="revoked") as raised:
            await hub.connected(_PATIENCE_S, once=once)
    assert raised.value.reason is HubReason.REFUSED


@in_virtual_time
async def test_who_tries_once_does_not_wait_for_another_attempt(monkeypatch: pytest.MonkeyPatch) -> None:
    async def open_one(server: str, **_: Any) -> None:
        raise UnreachableError(f"{server} is off")

    monkeypatch.setattr("fleet.connection.Session", SimpleNamespace(open=open_one))
    hub = Hub(FleetAddress(("a",)))
    task = asyncio.create_task(hub.run())
    with pytest.raises(UnreachableError, match="a is off"):
        await hub.connected(_PATIENCE_S, once=True)
    assert asyncio.get_running_loop().time() == pytest.approx(0.0)
    await cancel([task])


@in_virtual_time
async def test_no_refusal_is_reported_once_another_server_has_accepted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The end of the abandoned attempts may take longer than a caller waits."""

    async def open_one(server: str, **_: Any) -> Any:
        if server == "a":
            raise RefusedError("no such account")
        if server == "c":
            await asyncio.sleep(1.5)
            return SimpleNamespace(server="c", close=partial(asyncio.sleep, 0.0))
        try:
            await asyncio.sleep(3600.0)
        finally:
            await asyncio.sleep(10.0)  # it is slow to give up

    monkeypatch.setattr("fleet.connection.Session", SimpleNamespace(open=open_one))
    monkeypatch.setattr("fleet.connection.random.shuffle", lambda _servers: None)
    hub = Hub(FleetAddress(("a", "b", "c")))
    task = asyncio.create_task(hub.run())
    with pytest.raises(HubError) as raised:
        await hub.connected(_PATIENCE_S, once=True)
    assert raised.value.reason is HubReason.UNREACHABLE
    await cancel([task])
