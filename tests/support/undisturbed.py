"""Attempts that a stall of the machine has spoilt, which are begun anew.

The guard of the drive program replaces a worker that is silent for 60 ms while a driver has the robot, and a
driver who is late by 250 ms has to hold anew. On a machine that stalls for as long both are right, and end
what a test is about. A program that does so without need does it again: the test fails when no attempt is
left. A worker that ends by itself is no stall: the test fails at once.
"""

import warnings
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp
from typing import Final, NoReturn, Protocol, TypeVar

import psutil
import pytest

from tests.support.stalls import SPOILT_FROM_S, Stalls
from tests.support.waiting import wait_until

T = TypeVar("T")

ATTEMPTS: Final = 8
WORKER_LOST: Final = "the worker of the drive program was lost"
END: Final = "(exit code "
SILENT: Final = "no heartbeat of the worker for "
"""What the guard (drive/processes/guard.py) logs of each end of a worker, and of one that it killed for its
silence."""
_LOGGED_WITHIN_S: Final = 5.0
_ENDS_WITHIN_S: Final = 0.1
"""A process that was killed gives its memory back before it has ended; the zeros may be seen before that."""


class DisturbedError(Exception):
    """Raised by an attempt in which something else has happened than what was to be tested."""


class Program(Protocol):
    """The drive program: tests.support.running_drive, tests.support.driving."""

    @property
    def worker(self) -> psutil.Process:
        """The worker's process."""

    @property
    def log(self) -> Path:
        """Standard error of guard and worker."""


@contextmanager
def same_worker(program: Program) -> Iterator[psutil.Process]:
    """A part of an attempt in which the worker has to live; its silence explains whatever fails.

    Yields:
        The worker.

    Raises:
        DisturbedError: the guard has killed the worker for its silence.
        AssertionError: the worker has ended otherwise.
    """
    # The log first: of an end that is not there yet, the worker may be found for a moment longer.
    logged_bytes = program.log.stat().st_size
    worker = program.worker
    try:
        yield worker
    except Exception as error:
        _check(worker, program.log, logged_bytes, error)
        raise
    _check(worker, program.log, logged_bytes)


@contextmanager
def no_stall() -> Iterator[None]:
    """A part of an attempt in which a stall explains what fails: a driver who is late.

    Raises:
        DisturbedError: it has failed, and there was one.
    """
    with Stalls() as stalls:
        try:
            yield
        except AssertionError as error:
            if stalls.longest_s < SPOILT_FROM_S:
                raise
            raise DisturbedError(f"the machine stood still for {stalls.longest_s:.3f} s") from error


def undisturbed(attempt: Callable[[], T]) -> T:
    """Begins anew until an attempt was not disturbed; returns what it returns."""
    for _ in range(ATTEMPTS):
        try:
            return attempt()
        except DisturbedError as error:
            _begin_anew(error)
    return _give_up()


def without_stall(attempt: Callable[[Path], T], directory: Path) -> T:
    """Begins anew while a stall explains what fails; each attempt gets a directory of its own in this one."""

    def once() -> T:
        with no_stall():
            return attempt(Path(mkdtemp(dir=directory)))

    return undisturbed(once)


async def undisturbed_async(attempt: Callable[[], Awaitable[T]]) -> T:
    """As `undisturbed`, in an event loop."""
    for _ in range(ATTEMPTS):
        try:
            return await attempt()
        except DisturbedError as error:
            _begin_anew(error)
    return _give_up()


async def without_stall_async(attempt: Callable[[Path], Awaitable[T]], directory: Path) -> T:
    """As `without_stall`, in an event loop."""

    async def once() -> T:
        with no_stall():
            return await attempt(Path(mkdtemp(dir=directory)))

    return await undisturbed_async(once)


def _check(worker: psutil.Process, log: Path, logged_bytes: int, cause: Exception | None = None) -> None:
    ended, _ = psutil.wait_procs([worker], timeout=_ENDS_WITHIN_S)
    if not ended:
        return
    try:
        ends = wait_until(lambda: _ends(log, logged_bytes), "the log has the worker's end", _LOGGED_WITHIN_S)
    except AssertionError as error:
        raise error from cause
    for end in ends:
        if SILENT not in end:
            raise AssertionError(f"the worker of the drive program has ended by itself: {end}") from cause
    raise DisturbedError(WORKER_LOST) from cause


def _ends(log: Path, logged_bytes: int) -> list[str]:
    """Returns what a log has of workers' ends, after its first bytes."""
    lines = log.read_bytes()[logged_bytes:].decode(errors="replace").splitlines()
    return [line for line in lines if END in line]


def _begin_anew(error: DisturbedError) -> None:
    warnings.warn(f"begun anew: {error}", stacklevel=3)


def _give_up() -> NoReturn:
    pytest.fail(f"disturbed in all {ATTEMPTS} attempts")
