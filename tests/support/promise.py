"""Judges a measured figure by the documented number, where the machine was free enough to judge."""

import os
import time
import warnings
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final, NoReturn, Self

import pytest

from tests.support.stalls import SPOILT_FROM_S, Stalls
from tests.support.undisturbed import no_stall, undisturbed, undisturbed_async

_PRESSURE: Final = Path("/proc/pressure/cpu")
_PROCESSORS: Final = Path("/proc/stat")
_STOLEN: Final = 8
"""The word of a line of proc_stat(5) with the time that a virtual machine's host took from a processor."""
LOADED_FROM: Final = 0.6
"""Share of the time in which a program waited for a processor, from which on a late figure says nothing."""
STOLEN_FROM_S: Final = 0.02
"""Time in which the host ran something else on a processor of this virtual machine, from which on the same
holds: two ticks of the kernel's count."""
STALLED_FROM_S: Final = 0.03
"""For how long this process did not run, from which on that may explain a late figure: hosts stall machines
for 50 to 200 ms now and then, and not all of them say so."""
MS: Final = 1000.0
"""Per second, of a figure in milliseconds."""
ATTEMPTS: Final = 4


def keeps(
    promised: float, what: str, measure: Callable[[], float], *, per_stalled_s: float | None = 1.0
) -> float:
    """Measures until a figure is within the promise, and returns it.

    A figure beyond the promise fails the test, unless programs waited for a processor in LOADED_FROM of the
    time, the host took STOLEN_FROM_S from this machine, or this process stood still for long enough to
    explain it: then a warning says so, and it is measured again, ATTEMPTS times at most. A measurement that
    fails itself is begun anew where a stall explains that (tests.support.undisturbed).

    Args:
        promised: the documented number; a figure may reach it.
        what: the figure and its unit, for people.
        measure: returns the figure; may be called several times, and anew after a DisturbedError.
        per_stalled_s: by how much it grows at most when this process stands still, per second: 1 for seconds,
            MS for milliseconds; None: not with the time, as a count or a ratio.
    """

    def measured() -> tuple[_Attempt, float]:
        with _Attempt(promised, what, per_stalled_s) as attempt, no_stall():
            return attempt, measure()

    for _ in range(ATTEMPTS):
        attempt, figure = undisturbed(measured)
        if attempt.keeps(figure):
            return figure
    return _never_judged(what)


async def keeps_async(
    promised: float, what: str, measure: Callable[[], Awaitable[float]], *, per_stalled_s: float | None = 1.0
) -> float:
    """As `keeps`, for what is measured in an event loop."""

    async def measured() -> tuple[_Attempt, float]:
        with _Attempt(promised, what, per_stalled_s) as attempt, no_stall():
            return attempt, await measure()

    for _ in range(ATTEMPTS):
        attempt, figure = await undisturbed_async(measured)
        if attempt.keeps(figure):
            return figure
    return _never_judged(what)


class _Attempt:
    """One measurement, made while its block lasts."""

    def __init__(self, promised: float, what: str, per_stalled_s: float | None) -> None:
        self._promised = promised
        self._what = what
        self._per_stalled_s = per_stalled_s
        self._stalls = Stalls()
        self._before = self._after = _machine()

    def __enter__(self) -> Self:
        self._stalls.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stalls.__exit__(kind, error, trace)
        self._after = _machine()

    def keeps(self, figure: float) -> bool:
        """Returns whether the figure is within the promise; False: measure again."""
        if figure <= self._promised:
            return True
        before, after, stalled_s = self._before, self._after, self._stalls.longest_s
        load = (after.waited_s - before.waited_s) / (after.now_s - before.now_s)
        stolen_s = after.stolen_s - before.stolen_s
        beyond = f"{self._what}: {figure:.4g}, promised {self._promised:g}"
        machine = f"programs waited for a processor {load:.0%} of the time, the host took {stolen_s:.2f} s"
        machine += f", this process stood still for {stalled_s:.3f} s"
        late = self._is_explained_by(stalled_s, figure)
        if load < LOADED_FROM and stolen_s < STOLEN_FROM_S and not late:
            pytest.fail(f"{beyond}; {machine}")
        warnings.warn(f"{beyond}; not judged: {machine}", stacklevel=3)
        return False

    def _is_explained_by(self, stalled_s: float, figure: float) -> bool:
        """Whether a figure beyond the promise would have been within it without a stall."""
        if self._per_stalled_s is None:
            return stalled_s >= SPOILT_FROM_S
        return stalled_s >= STALLED_FROM_S and figure - self._promised <= stalled_s * self._per_stalled_s


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
