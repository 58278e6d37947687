"""Attempts that a stall of the machine has spoilt, which are begun anew.

The guard of the drive program replaces a worker that is silent for 60 ms while a driver has the robot, and a
driver who is late by 250 ms has to hold anew. On a machine that stalls for as long both are right, and end
what a test is about. A program that does so without need does it again: the test fails when no attempt is
left.
"""

import warnings
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Final, NoReturn, TypeVar

import psutil
import pytest

T = TypeVar("T")

ATTEMPTS: Final = 8
WORKER_LOST: Final = "the worker of the drive program was lost"
_ENDS_WITHIN_S: Final = 0.1
"""A process that was killed gives its memory back before it has ended; the zeros may be seen before that."""


class DisturbedError(Exception):
    """Raised by an attempt in which something else has happened than what was to be tested."""


@contextmanager
def same_worker(worker: psutil.Process) -> Iterator[None]:
    """A part of an attempt in which a worker has to live; its loss explains whatever fails.

    Raises:
        DisturbedError: the worker was lost.
    """
    try:
        yield
    except Exception as error:
        _check(worker, error)
        raise
    _check(worker)


def undisturbed(attempt: Callable[[], T]) -> T:
    """Begins anew until an attempt was not disturbed; returns what it returns."""
    for _ in range(ATTEMPTS):
        try:
            return attempt()
        except DisturbedError as error:
            _begin_anew(error)
    return _give_up()


async def undisturbed_async(attempt: Callable[[], Awaitable[T]]) -> T:
    """As `undisturbed`, in an event loop."""
    for _ in range(ATTEMPTS):
        try:
            return await attempt()
        except DisturbedError as error:
            _begin_anew(error)
    return _give_up()


def _check(worker: psutil.Process, cause: Exception | None = None) -> None:
    if isinstance(cause, DisturbedError):
        return
    ended, _ = psutil.wait_procs([worker], timeout=_ENDS_WITHIN_S)
    if ended:
        raise DisturbedError(WORKER_LOST) from cause


def _begin_anew(error: DisturbedError) -> None:
    warnings.warn(f"begun anew: {error}", stacklevel=3)


def _give_up() -> NoReturn:
    pytest.fail(f"disturbed in all {ATTEMPTS} attempts")
