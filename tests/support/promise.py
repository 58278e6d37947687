"""Judges a measured figure by the documented number, where the machine was free enough to judge."""

import os
import time
import warnings
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NoReturn

import pytest

_PRESSURE: Final = Path("/proc/pressure/cpu")
_PROCESSORS: Final = Path("/proc/stat")
_STOLEN: Final = 8
"""The word of a line of proc_stat(5) with the time that a virtual machine's host took from a processor."""
LOADED_FROM: Final = 0.6
"""Share of the time in which a program waited for a processor, from which on a late figure says nothing."""
STOLEN_FROM_S: Final = 0.02
"""Time in which the host ran something else on a processor of this virtual machine, from which on the same
holds: two ticks of the kernel's count."""
ATTEMPTS: Final = 4


def keeps(promised: float, what: str, measure: Callable[[], float]) -> float:
    """Measures until a figure is within the promise, and returns it.

    A figure beyond the promise fails the test, unless programs waited for a processor in LOADED_FROM of the
    time, or the host took STOLEN_FROM_S from this machine: then a warning says so, and it is measured again.

    Args:
        promised: the documented number; a figure may reach it.
        what: the figure and its unit, for people.
        measure: returns the figure; may be called several times.
    """
    for _ in range(ATTEMPTS):
        attempt = _Attempt(promised, what)
        if attempt.keeps(figure := measure()):
            return figure
    return _never_judged(what)


async def keeps_async(promised: float, what: str, measure: Callable[[], Awaitable[float]]) -> float:
    """As `keeps`, for what is measured in an event loop."""
    for _ in range(ATTEMPTS):
        attempt = _Attempt(promised, what)
        if attempt.keeps(figure := await measure()):
            return figure
    return _never_judged(what)


class _Attempt:
    """One measurement, begun when it is made."""

    def __init__(self, promised: float, what: str) -> None:
        self._promised = promised
        self._what = what
        self._before = _machine()

    def keeps(self, figure: float) -> bool:
        """Returns whether the figure is within the promise; False: measure again."""
        if figure <= self._promised:
            return True
        before, after = self._before, _machine()
        load = (after.waited_s - before.waited_s) / (after.now_s - before.now_s)
        stolen_s = after.stolen_s - before.stolen_s
        beyond = f"{self._what}: {figure:.4g}, promised {self._promised:g}"
        machine = f"programs waited for a processor {load:.0%} of the time, the host took {stolen_s:.2f} s"
        if load < LOADED_FROM and stolen_s < STOLEN_FROM_S:
            pytest.fail(f"{beyond}; {machine}")
        warnings.warn(f"{beyond}; not judged: {machine}", stacklevel=3)
        return False


def _never_judged(what: str) -> NoReturn:
    pytest.fail(f"{what}: the machine was too loaded to judge in all {ATTEMPTS} attempts")


@dataclass(frozen=True, slots=True)
class _Machine:
    """What has kept programs from running, since the start of the machine; seconds.

    Attributes:
        now_s: the present.
        waited_s: how long at least one program has had to wait for a processor.
        stolen_s: how long the host has run something else on a processor.
    """

    now_s: float
    waited_s: float
    stolen_s: float


def _machine() -> _Machine:
    """Reads it. Kernels without pressure stall information count as free: they never excuse a figure."""
    now_s = time.monotonic()
    processors = _PROCESSORS.read_text(encoding="ascii").partition("\n")[0].split()
    stolen_s = int(processors[_STOLEN]) / os.sysconf("SC_CLK_TCK")
    try:
        fields = _PRESSURE.read_text(encoding="ascii").splitlines()[0].split()
    except OSError:
        return _Machine(now_s, 0.0, stolen_s)
    return _Machine(now_s, int(fields[-1].removeprefix("total=")) / 1e6, stolen_s)
