"""Promises are judged at their number, on a machine that is free enough to judge."""

import asyncio
import ctypes
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field

import pytest

from tests.support import promise
from tests.support.promise import (
    ATTEMPTS,
    LOADED_FROM,
    MS,
    STALLED_FROM_S,
    STOLEN_FROM_S,
    keeps,
    keeps_async,
)
from tests.support.stalls import SPOILT_FROM_S, Stalls

FREE, LOADED = LOADED_FROM - 0.01, LOADED_FROM + 0.01
NOT_PERMITTED = 77
TAKES_A_PROCESSOR = f"""
import os, sys, time
os.sched_setaffinity(0, {{int(sys.argv[1])}})
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
except PermissionError:
    sys.exit({NOT_PERMITTED})
until_s = time.monotonic() + 0.15
while time.monotonic() < until_s:
    pass
"""


@dataclass
class Attempts:
    """What the machine is like in each attempt, which takes a second."""

    loads: list[float] = field(default_factory=list)
    """The share of the time in which a program waits for a processor."""
    stolen_s: list[float] = field(default_factory=list)
    """What the host takes; nothing where the list has ended."""
    stalled_s: list[float] = field(default_factory=list)
    """For how long this process stands still; not at all where the list has ended."""


@dataclass
class PlayedStalls(AbstractContextManager[None]):
    """Stalls that nothing on this machine has made."""

    longest_s: float

    def __exit__(self, *_: object) -> None:
        pass


@pytest.fixture
def attempts(monkeypatch: pytest.MonkeyPatch) -> Attempts:
    made = Attempts()

    def clock() -> Iterator[promise._Machine]:
        now = promise._Machine(0.0, 0.0, 0.0)
        while True:
            yield now
            stolen_s = made.stolen_s.pop(0) if made.stolen_s else 0.0
            now = promise._Machine(now.now_s + 1.0, now.waited_s + made.loads.pop(0), now.stolen_s + stolen_s)
            yield now

    ticks = clock()
    monkeypatch.setattr(promise, "_machine", lambda: next(ticks))
    monkeypatch.setattr(
        promise, "Stalls", lambda: PlayedStalls(made.stalled_s.pop(0) if made.stalled_s else 0.0)
    )
    return made


def test_a_figure_at_the_promise_is_within_it() -> None:
    assert keeps(2.0, "s", lambda: 2.0) == 2.0


def test_a_figure_beyond_it_fails_at_once_on_a_free_machine(attempts: Attempts) -> None:
    attempts.loads += [FREE]
    with pytest.raises(pytest.fail.Exception, match=r"s until: 2.1, promised 2; .* 59% of .* 0.00 s"):
        keeps(2.0, "s until", lambda: 2.1)


def test_on_a_loaded_machine_it_is_reported_and_measured_again(attempts: Attempts) -> None:
    attempts.loads += [LOADED, FREE]
    figures = iter([9.0, 1.5])
    with pytest.warns(UserWarning, match="not judged: programs waited for a processor 61%"):
        assert keeps(2.0, "s", lambda: next(figures)) == 1.5


@pytest.mark.parametrize(("stolen_s", "judged"), [(0.01, True), (STOLEN_FROM_S, False)])
def test_what_the_host_takes_is_no_fault_of_the_product(
    attempts: Attempts, stolen_s: float, judged: bool
) -> None:
    attempts.loads += [FREE, FREE]
    attempts.stolen_s += [stolen_s]
    figures = iter([9.0, 1.5])
    if judged:
        with pytest.raises(pytest.fail.Exception, match="promised 2"):
            keeps(2.0, "s", lambda: next(figures))
        return
    with pytest.warns(UserWarning, match="not judged: .* the host took 0.02 s"):
        assert keeps(2.0, "s", lambda: next(figures)) == 1.5


@pytest.mark.parametrize(
    ("late", "per_stalled_s", "stalled_s"),
    [(0.02, 1.0, STALLED_FROM_S), (0.19, 1.0, 0.2), (29.0, MS, 0.03), (1.0, None, SPOILT_FROM_S)],
    ids=["s", "s, longer", "ms", "a count"],
)
def test_what_a_stall_of_the_machine_has_made_late_is_measured_again(
    attempts: Attempts, late: float, per_stalled_s: float | None, stalled_s: float
) -> None:
    attempts.loads += [FREE, FREE]
    attempts.stalled_s += [stalled_s]
    figures = iter([2.0 + late, 1.5])
    with pytest.warns(UserWarning, match=f"not judged: .* stood still for {stalled_s:.3f} s"):
        assert keeps(2.0, "it", lambda: next(figures), per_stalled_s=per_stalled_s) == 1.5


@pytest.mark.parametrize(
    ("late", "per_stalled_s", "stalled_s"),
    [(0.02, 1.0, 0.025), (1.5, 1.0, 0.1), (110.0, MS, 0.1), (1.0, None, 0.19)],
    ids=["too short to explain", "s", "ms", "a count"],
)
async def test_a_stall_that_is_too_short_for_what_is_late_is_no_excuse(
    attempts: Attempts, late: float, per_stalled_s: float | None, stalled_s: float
) -> None:
    async def measure() -> float:
        return 2.0 + late

    attempts.loads += [FREE, FREE]
    attempts.stalled_s += [stalled_s] * 2
    with pytest.raises(pytest.fail.Exception, match="promised 2"):
        keeps(2.0, "it", lambda: 2.0 + late, per_stalled_s=per_stalled_s)
    with pytest.raises(pytest.fail.Exception, match="promised 2"):
        await keeps_async(2.0, "it", measure, per_stalled_s=per_stalled_s)


async def test_what_fails_within_a_measurement_is_begun_anew_after_a_stall_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stalls, failures = PlayedStalls(SPOILT_FROM_S), iter([True, False, True, False, True])
    monkeypatch.setattr("tests.support.undisturbed.Stalls", lambda: stalls)

    def measure() -> float:
        assert not next(failures)
        return 1.5

    async def measure_in_a_loop() -> float:
        return measure()

    with pytest.warns(UserWarning, match="begun anew: the machine stood still"):
        assert keeps(2.0, "s", measure) == 1.5
    with pytest.warns(UserWarning, match="begun anew: the machine stood still"):
        assert await keeps_async(2.0, "s", measure_in_a_loop) == 1.5
    stalls.longest_s = SPOILT_FROM_S - 0.001
    with pytest.raises(AssertionError):
        keeps(2.0, "s", measure)


def test_a_process_that_stands_still_is_noticed() -> None:
    with Stalls() as stalls:
        ctypes.PyDLL(None).usleep(150_000)  # of a library for Python's own functions: no other thread runs
    assert stalls.longest_s > 0.1


def test_before_anything_has_run_there_was_no_stall() -> None:
    assert Stalls().longest_s == 0.0


def test_a_stall_that_ends_as_it_is_asked_for_is_noticed() -> None:
    """The thread that looks is to have run a second ago, and has not yet run again."""
    stalls = Stalls()
    vars(stalls)["_due_s"][0] = time.monotonic() - 1.0
    assert stalls.longest_s >= 1.0


@pytest.mark.parametrize("processor", sorted(os.sched_getaffinity(0)))
def test_a_processor_that_stands_still_is_noticed(processor: int) -> None:
    with Stalls() as stalls:
        done = subprocess.run(
            [sys.executable, "-c", TAKES_A_PROCESSOR, str(processor)], timeout=60, check=False
        )
    if done.returncode == NOT_PERMITTED:
        pytest.skip("only root, and who may use real-time priorities, can take a processor")
    assert done.returncode == 0
    assert stalls.longest_s > 0.1


def test_the_machine_that_this_runs_on_is_read() -> None:
    before, after = promise._machine(), promise._machine()
    assert after.now_s > before.now_s
    assert after.waited_s >= before.waited_s >= 0
    assert after.stolen_s >= before.stolen_s >= 0


def test_a_machine_that_is_always_loaded_fails_the_test(attempts: Attempts) -> None:
    attempts.loads += [LOADED] * ATTEMPTS
    with (
        pytest.warns(UserWarning, match="not judged"),
        pytest.raises(pytest.fail.Exception, match="too loaded to judge"),
    ):
        keeps(2.0, "s", lambda: 9.0)


def test_measurements_in_an_event_loop_are_judged_alike(attempts: Attempts) -> None:
    attempts.loads += [LOADED, FREE]
    figures = iter([9.0, 2.5])

    async def measure() -> float:
        return next(figures)

    with (
        pytest.warns(UserWarning, match="not judged"),
        pytest.raises(pytest.fail.Exception, match="promised 2"),
    ):
        asyncio.run(keeps_async(2.0, "s", measure))
