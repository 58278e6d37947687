"""The terminal of robotctl drive: what it reports of its keys, and whether it still answers.

It is written to on standard error, which is the terminal also where standard output is a file.
"""

import asyncio
import select
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack, asynccontextmanager, contextmanager, suppress
from typing import Final

from console.cli import drive_keys
from console.cli.drive_keys import Action, Hands, Liveness
from console.cli.keyboard import Keyboard

_ANSWER_WITHIN_S: Final = 0.2
"""How long a terminal may take to say which keyboard protocol it speaks."""
_MOST_READS: Final = 256
"""For one answer, which may come byte by byte, with keys before it."""


@asynccontextmanager
async def reporting_keys(keyboard: Keyboard, take: Callable[[list[Action]], object]) -> AsyncIterator[Hands]:
    """Makes the terminal report releases, where it can, and its focus, while the block lasts.

    Args:
        keyboard: Of the terminal.
        take: Is given at once what is to be done by the keys that are typed while an answer is awaited before
            the block, or after it.

    Yields:
        The hands on its keys.
    """
    hands = Hands(releases=False, begun=False)
    try:
        with ExitStack() as modes:
            await _begin(keyboard, hands, modes, take)
            _write(drive_keys.FOCUS_BEGIN)
            modes.callback(_write, drive_keys.FOCUS_END)
            yield hands
    finally:
        await _take_last_answer(keyboard, hands, take)


@contextmanager
def reading(keyboard: Keyboard, take: Callable[[str | None], None]) -> Iterator[None]:
    """Passes on what is typed while the block lasts; None when the terminal is gone."""
    loop = asyncio.get_running_loop()
    loop.add_reader(keyboard.fileno, lambda: take(keyboard.typed()))
    try:
        yield
    finally:
        loop.remove_reader(keyboard.fileno)


def ask(request: str) -> None:
    """Requests a sign of life; its answer is typed."""
    _write(request)


async def _begin(
    keyboard: Keyboard, hands: Hands, modes: ExitStack, take: Callable[[list[Action]], object]
) -> None:
    """Makes it report releases until the modes are left, and say that it does: some have the rest alone.

    Presses alone have a liveness, too, if all that was requested was answered in time.
    """
    asked_s = time.monotonic()
    answer = await _answer(keyboard, hands, take)
    if drive_keys.flags_in(answer) is not None:
        with ExitStack() as begun:
            _write(drive_keys.RELEASES_BEGIN)
            begun.callback(_write, drive_keys.RELEASES_END)
            asked_s = time.monotonic()
            answer = await _answer(keyboard, hands, take)
            if drive_keys.report_releases(drive_keys.flags_in(answer)):
                modes.push(begun.pop_all())
                hands.begin(releases=True, liveness=Liveness(asked_s))
                return
    marks = drive_keys.has_status(answer)
    liveness = Liveness(asked_s, releases=False, marks=marks) if answer else None
    hands.begin(releases=False, liveness=liveness)


async def _answer(keyboard: Keyboard, hands: Hands, take: Callable[[list[Action]], object]) -> str:
    """Returns what the terminal answers to ASK_ALL; nothing unless all of it comes in time.

    What is to be done by the keys before it is passed on.
    """
    until_s = asyncio.get_running_loop().time() + _ANSWER_WITHIN_S
    _write(drive_keys.ASK_ALL)
    answer = ""
    for _ in range(_MOST_READS):
        typed = await _typed(keyboard, until_s)
        if typed is None:
            return ""
        take(hands.take(typed, time.monotonic()))
        answer += typed
        if drive_keys.is_complete(answer):
            return answer
    return ""


async def _take_last_answer(keyboard: Keyboard, hands: Hands, take: Callable[[list[Action]], object]) -> None:
    """Waits for an answer that is on its way, which would be typed in the shell; not for long.

    What is to be done by the keys before it is passed on.
    """
    until_s = asyncio.get_running_loop().time() + _ANSWER_WITHIN_S
    for _ in range(_MOST_READS):
        if not hands.awaits_answer or (typed := await _typed(keyboard, until_s)) is None:
            return
        take(hands.take(typed, time.monotonic()))


async def _typed(keyboard: Keyboard, until_s: float) -> str | None:
    """Returns what is typed until an instant of the loop; None if nothing is, or the terminal is gone.

    What is there counts also after that instant: this program may have stood still meanwhile.
    """
    loop = asyncio.get_running_loop()
    readable = loop.create_future()
    loop.add_reader(keyboard.fileno, _wake, readable)
    try:
        async with asyncio.timeout_at(until_s):
            await readable
    except TimeoutError:
        if not select.select([keyboard.fileno], [], [], 0)[0]:
            return None
    finally:
        loop.remove_reader(keyboard.fileno)
    return keyboard.typed()


def _wake(readable: "asyncio.Future[None]") -> None:
    if not readable.done():
        readable.set_result(None)


def _write(codes: str) -> None:
    # A terminal that was closed under the program has no modes; reading it says so, and ends the driving.
    with suppress(OSError):
        print(codes, end="", file=sys.stderr, flush=True)
