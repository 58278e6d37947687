"""Several servers are tried side by side when they are silent, and one session is what comes of it."""

import asyncio
import itertools
from collections.abc import Sequence
from typing import Any

import pytest

from fleet.errors import HubError, HubReason, RefusedError, UnreachableError
from fleet.opening import NEXT_AFTER_S, REFUSED_AFTER_S, first_to_open
from tests.support.virtual_time import in_virtual_time

_TIMEOUT_S = 5.0
"""Of an attempt at a server that is silent."""


class Servers:
    """Servers that answer after so many seconds, with a session or an error; others are silent.

    Attributes:
        tried: which, and when.
        open: sessions that stand.
        ended: attempts that were cancelled.
    """

    def __init__(self, **answers: tuple[float, HubError | None]) -> None:
        self._answers = answers
        self.tried: list[tuple[str, float]] = []
        self.open: list[str] = []
        self.ended: list[str] = []

    async def open_one(self, server: str) -> Any:
        self.tried.append((server, asyncio.get_running_loop().time()))
        silent = (_TIMEOUT_S, UnreachableError(f"{server} can't be reached"))
        after_s, error = self._answers.get(server, silent)
        try:
            await asyncio.sleep(after_s)
        except asyncio.CancelledError:
            self.ended.append(server)
            raise
        if error is not None:
            raise error
        self.open.append(server)
        return Opened(self, server)

    async def first(self, *servers: str) -> Any:
        return await first_to_open(servers, self.open_one)

    @property
    def times(self) -> Sequence[float]:
        """When servers were tried."""
        return [at_s for _, at_s in self.tried]


class Opened:
    """A session with a server."""

    def __init__(self, servers: Servers, server: str) -> None:
        self._servers = servers
        self.server = server

    async def close(self) -> None:
        """Takes as long as a server that reads nothing has it take."""
        await asyncio.sleep(1)
        self._servers.open.remove(self.server)


@in_virtual_time
async def test_the_next_one_is_tried_beside_one_that_is_silent() -> None:
    servers = Servers(b=(0.25, None))
    first = await servers.first("a", "b", "c")
    assert first.server == "b"
    assert servers.tried == [("a", 0), ("b", NEXT_AFTER_S)]
    assert servers.ended == ["a"], "nothing goes on"
    assert asyncio.get_running_loop().time() == NEXT_AFTER_S + 0.25


@in_virtual_time
async def test_one_that_answers_at_once_is_the_only_one_that_is_tried() -> None:
    servers = Servers(a=(NEXT_AFTER_S / 2, None), b=(0, None))
    assert (await servers.first("a", "b")).server == "a"
    assert servers.tried == [("a", 0)]


@in_virtual_time
async def test_one_that_can_not_be_reached_is_not_waited_for() -> None:
    servers = Servers(a=(0.1, UnreachableError("no route")), b=(0.1, UnreachableError("closed")), c=(0, None))
    assert (await servers.first("a", "b", "c")).server == "c"
    assert servers.times == pytest.approx([0, 0.1, 0.2])


@in_virtual_time
async def test_one_that_is_slow_is_still_taken_when_it_is_first() -> None:
    servers = Servers(a=(1.5 * NEXT_AFTER_S, None), b=(NEXT_AFTER_S, None))
    assert (await servers.first("a", "b")).server == "a"
    assert servers.ended == ["b"]


@in_virtual_time
async def test_of_two_that_answer_in_one_moment_one_is_closed() -> None:
    servers = Servers(a=(2 * NEXT_AFTER_S, None), b=(NEXT_AFTER_S, None))
    first = await servers.first("a", "b")
    assert servers.open == [first.server]


@in_virtual_time
async def test_without_an_answer_it_ends_with_the_last_time_out() -> None:
    servers = Servers()
    with pytest.raises(UnreachableError, match="c can't be reached"):
        await servers.first("a", "b", "c")
    assert asyncio.get_running_loop().time() == 2 * NEXT_AFTER_S + _TIMEOUT_S


@in_virtual_time
async def test_a_refusal_says_more_than_silence() -> None:
    servers = Servers(b=(0.1, RefusedError("revoked")))
    with pytest.raises(HubError, match="revoked") as refused:
        await servers.first("a", "b", "c")
    assert refused.value.reason is HubReason.REFUSED
    assert [server for server, _ in servers.tried] == ["a", "b", "c"], "another one may accept them"


@in_virtual_time
async def test_which_is_not_kept_back_until_a_silent_one_has_timed_out() -> None:
    """The defect: callers that wait for 5 s reported that no server answers."""
    for order in itertools.permutations("abc"):
        servers = Servers(a=(0.1, RefusedError("revoked")))
        begun_s = asyncio.get_running_loop().time()
        with pytest.raises(RefusedError, match="revoked"):
            await servers.first(*order)
        assert len(servers.tried) == 3, "another one may accept them"
        assert asyncio.get_running_loop().time() - begun_s <= 2 * NEXT_AFTER_S + REFUSED_AFTER_S
        assert sorted(servers.ended) == ["b", "c"]


_REFUSAL = (0.1, RefusedError("not known yet"))


@pytest.mark.parametrize("slow_s", [0.9, 1.5, 2.5])
@in_virtual_time
async def test_one_that_is_slow_is_still_taken_where_the_others_refuse(slow_s: float) -> None:
    """The defect: after 1 s it was given up, and with the next attempt again.

    A node that has lost its accounts refuses all robots, and when another one dies, its robots come to the
    third one all at once.
    """
    for order in itertools.permutations("abc"):
        servers = Servers(a=_REFUSAL, b=_REFUSAL, c=(slow_s, None))
        assert (await servers.first(*order)).server == "c", order


@pytest.mark.parametrize("slow_s", [0.9, 1.5, 2.5])
@in_virtual_time
async def test_also_where_another_one_is_silent(slow_s: float) -> None:
    for order in itertools.permutations("abc"):
        servers = Servers(a=_REFUSAL, c=(slow_s, None))
        assert (await servers.first(*order)).server == "c", order


@in_virtual_time
async def test_after_a_refusal_other_failures_do_not_prolong_the_wait() -> None:
    servers = Servers(a=_REFUSAL, b=(2.0, UnreachableError("closed")))
    with pytest.raises(RefusedError):
        await servers.first("a", "b", "c")
    assert asyncio.get_running_loop().time() == pytest.approx(0.1 + NEXT_AFTER_S + REFUSED_AFTER_S)


@in_virtual_time
async def test_a_refusal_that_comes_late_ends_the_wait() -> None:
    servers = Servers(a=(4.0, RefusedError("revoked")))
    with pytest.raises(RefusedError):
        await servers.first("a", "b")
    assert asyncio.get_running_loop().time() == pytest.approx(4.0)


@in_virtual_time
async def test_without_servers_there_is_none() -> None:
    with pytest.raises(UnreachableError, match="no server"):
        await Servers().first()


@in_virtual_time
async def test_who_is_cancelled_leaves_nothing_open() -> None:
    """At each moment of it, also while those that were too late are closed."""
    for moment_s in (0.5, 1.5, 2.0, 2.5):
        servers = Servers(a=(2 * NEXT_AFTER_S, None), b=(NEXT_AFTER_S, None))
        opening = asyncio.create_task(servers.first("a", "b"))
        await asyncio.wait([opening], timeout=moment_s)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening
        assert not servers.open, moment_s
