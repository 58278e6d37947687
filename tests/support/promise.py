"""Judges a measured figure by the documented number, where the machine was free enough to judge."""

import time
import warnings
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Final, NoReturn

import pytest

_PRESSURE: Final = Path("/proc/pressure/cpu")
LOADED_FROM: Final = 0.6
"""Share of the time in which a program waited for a processor, from which on a late figure says nothing."""
ATTEMPTS: Final = 4


def keeps(promised: float, what: str, measure: Callable[[], float]) -> float:
    """Measures until a figure is within the promise, and returns it.

    A figure beyond the promise fails the test, unless programs waited for a processor in LOADED_FROM of the
    time: then a warning says so, and it is measured again.

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
        self._waited_s, self._begun_s = _waited_and_now_s()

    def keeps(self, figure: float) -> bool:
        """Returns whether the figure is within the promise; False: measure again."""
        if figure <= self._promised:
            return True
        waited_s, now_s = _waited_and_now_s()
        load = (waited_s - self._waited_s) / (now_s - self._begun_s)
        beyond = f"{self._what}: {figure:.4g}, promised {self._promised:g}"
        if load < LOADED_FROM:
            pytest.fail(f"{beyond}; programs waited for a processor {load:.0%} of the time")
        warnings.warn(f"{beyond}; not judged, the machine is too loaded ({load:.0%})", stacklevel=3)
        return False


def _never_judged(what: str) -> NoReturn:
    pytest.fail(f"{what}: the machine was too loaded to judge in all {ATTEMPTS} attempts")


def _waited_and_now_s() -> tuple[float, float]:
    """Returns how long at least one program has had to wait for a processor until now, and the present.

    Kernels without pressure stall information count as free: they never excuse a figure.
    """
    now_s = time.monotonic()
    try:
        fields = _PRESSURE.read_text(encoding="ascii").splitlines()[0].split()
    except OSError:
        return 0.0, now_s
    return int(fields[-1].removeprefix("total=")) / 1e6, now_s
