"""Promises are judged at their number, on a machine that is free enough to judge."""

import asyncio
from collections.abc import Iterator

import pytest

from tests.support import promise
from tests.support.promise import ATTEMPTS, LOADED_FROM, keeps, keeps_async

FREE, LOADED = LOADED_FROM - 0.01, LOADED_FROM + 0.01


@pytest.fixture
def loads(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The share of the time in which a program waits for a processor, attempt by attempt; a second each."""
    shares: list[float] = []

    def clock() -> Iterator[tuple[float, float]]:
        waited_s = now_s = 0.0
        while True:
            yield waited_s, now_s
            waited_s, now_s = waited_s + shares.pop(0), now_s + 1.0
            yield waited_s, now_s

    ticks = clock()
    monkeypatch.setattr(promise, "_waited_and_now_s", lambda: next(ticks))
    return shares


def test_a_figure_at_the_promise_is_within_it() -> None:
    assert keeps(2.0, "s", lambda: 2.0) == 2.0


def test_a_figure_beyond_it_fails_at_once_on_a_free_machine(loads: list[float]) -> None:
    loads += [FREE]
    with pytest.raises(pytest.fail.Exception, match=r"s until: 2.1, promised 2; .* 59% of the time"):
        keeps(2.0, "s until", lambda: 2.1)


def test_on_a_loaded_machine_it_is_reported_and_measured_again(loads: list[float]) -> None:
    loads += [LOADED, FREE]
    figures = iter([9.0, 1.5])
    with pytest.warns(UserWarning, match="not judged, the machine is too loaded"):
        assert keeps(2.0, "s", lambda: next(figures)) == 1.5


def test_a_machine_that_is_always_loaded_fails_the_test(loads: list[float]) -> None:
    loads += [LOADED] * ATTEMPTS
    with (
        pytest.warns(UserWarning, match="not judged"),
        pytest.raises(pytest.fail.Exception, match="too loaded to judge"),
    ):
        keeps(2.0, "s", lambda: 9.0)


def test_measurements_in_an_event_loop_are_judged_alike(loads: list[float]) -> None:
    loads += [LOADED, FREE]
    figures = iter([9.0, 2.5])

    async def measure() -> float:
        return next(figures)

    with (
        pytest.warns(UserWarning, match="not judged"),
        pytest.raises(pytest.fail.Exception, match="promised 2"),
    ):
        asyncio.run(keeps_async(2.0, "s", measure))
