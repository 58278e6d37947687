"""The terminal of robotctl drive: what it reports of its keys, and whether it still answers.

It is written to on standard error, which is the terminal also where standard output is a file.
"""

import asyncio
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack, asynccontextmanager, contextmanager, suppress
from typing import Final

from console.cli import drive_keys
from console.cli.drive_keys import Liveness
from console.cli.keyboard import Keyboard

_ANSWER_WITHIN_S: Final = 0.2
"""How long a terminal may take to say which keyboard protocol it speaks."""


@asynccontextmanager
async def reporting_keys(keyboard: Keyboard) -> AsyncIterator[Liveness | None]:
    """Makes the terminal report releases, where it can, and its focus, while the block lasts.

    Yields whether it still answers; None for a terminal that does not report releases.
    """
    with ExitStack() as modes:
        liveness = await _report_releases(keyboard, modes)
        _write(drive_keys.FOCUS_BEGIN)
        modes.callback(_write, drive_keys.FOCUS_END)
        yield liveness


@contextmanager
def reading(keyboard: Keyboard, take: Callable[[str | None], None]) -> Iterator[None]:
    """Passes on what is typed while the block lasts; None when the terminal is gone."""
    loop = asyncio.get_running_loop()
    loop.add_reader(keyboard.fileno, lambda: take(keyboard.typed()))
    try:
        yield
    finally:
        loop.remove_reader(keyboard.fileno)


def ask() -> None:
    """Requests a sign of life; its answer is typed."""
    _write(drive_keys.ASK)


async def _report_releases(keyboard: Keyboard, modes: ExitStack) -> Liveness | None:
    """Makes it report releases until the modes are left, and say that it does: some have the rest alone."""
    if drive_keys.flags_in(await _answer(keyboard)) is None:
        return None
    with ExitStack() as begun:
        _write(drive_keys.RELEASES_BEGIN)
        begun.callback(_write, drive_keys.RELEASES_END)
        asked_s = time.monotonic()
        if not drive_keys.report_releases(drive_keys.flags_in(await _answer(keyboard))):
            return None
        modes.push(begun.pop_all())
        return Liveness(asked_s)


async def _answer(keyboard: Keyboard) -> str:
    """Returns what the terminal answers to ASK_ALL; nothing unless all of it comes in time."""
    _write(drive_keys.ASK_ALL)
    answer, loop = "", asyncio.get_running_loop()
    until_s = loop.time() + _ANSWER_WITHIN_S
    while not drive_keys.is_complete(answer):
        readable = loop.create_future()
        loop.add_reader(keyboard.fileno, _wake, readable)
        try:
            async with asyncio.timeout_at(until_s):
                await readable
        except TimeoutError:
            return ""
        finally:
            loop.remove_reader(keyboard.fileno)
        typed = keyboard.typed()
        if typed is None:
            return ""
        answer += typed
    return answer


def _wake(readable: "asyncio.Future[None]") -> None:
    if not readable.done():
        readable.set_result(None)


def _write(codes: str) -> None:
    # A terminal that was closed under the program has no modes; reading it says so, and ends the driving.
    with suppress(OSError):
        print(codes, end="", file=sys.stderr, flush=True)
