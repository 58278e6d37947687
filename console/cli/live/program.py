"""robotctl watch on a terminal: looks, keys, signals and the robot's answers, all in one loop.

Nothing here waits for anything but the loop: a key never holds up the redraw, and a robot that does not
answer never holds up a key.
"""

import asyncio
import signal
import time
from collections.abc import Callable, Coroutine, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Final

from console.cli.live.keyboard import Keyboard, there_is_one
from console.cli.live.keys import Key, keys_in
from console.cli.live.picture import Fitted, picture
from console.cli.live.screen import Screen
from console.cli.live.wishes import Wish, Wishes
from console.cli.look import Look
from console.cli.session import Session
from console.client import GatewayError, Outage, WatchedStatus

_MS_PER_S: Final = 1000
# Sentences go out of date, and the age of old values counts up, between two looks as well.
_REDRAW_EVERY_S: Final = 1.0
_ENDING: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


def watch_on_a_terminal(session: Session, interval_s: float, count: int | None) -> None:
    """Shows what the robot tells, `interval_s` apart at least, until q, SIGINT or SIGTERM, or `count` times.

    Raises:
        GatewayError: the very first look failed. Later the robot may come and go: that is shown.
    """
    asyncio.run(_Watch(session, interval_s, count).run())


class _Watch:
    """One run."""

    def __init__(self, session: Session, interval_s: float, count: int | None) -> None:
        self._session = session
        self._interval_s = interval_s
        self._count = count
        self._wishes = Wishes()
        self._keyboard = Keyboard() if there_is_one() else None
        self._over = asyncio.Event()
        self._changed = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Until it is over."""
        with _signals(dict.fromkeys(_ENDING, self._over.set)):
            async with self._session.connect_async() as self._robot:
                self._told = self._robot.watch_status(self._interval_s)
                if await self._first_look():
                    await self._show_until_over()

    async def _first_look(self) -> bool:
        asking = asyncio.create_task(self._next())
        ending = asyncio.create_task(self._over.wait())
        try:
            await asyncio.wait((asking, ending), return_when=asyncio.FIRST_COMPLETED)
            if not asking.done():
                return False
            self._take(asking.result())
            return True
        finally:
            for task in (asking, ending):
                task.cancel()

    async def _show_until_over(self) -> None:
        self._screen = Screen(self._session.out, self._keyboard, self._last_picture)
        signals = {
            signal.SIGTSTP: self._on_suspend,
            signal.SIGCONT: self._on_continue,
            signal.SIGWINCH: self._changed.set,
        }
        with self._screen, _signals(signals), self._keys():
            self._begin(self._follow())
            self._begin(self._redraw())
            try:
                await self._over.wait()
            finally:
                for task in self._tasks:
                    task.cancel()
                ended = await asyncio.gather(*self._tasks, return_exceptions=True)
        for outcome in ended:
            if isinstance(outcome, Exception):
                raise outcome

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._on_end_of)

    def _on_end_of(self, task: "asyncio.Task[None]") -> None:
        # A wish that was carried out is forgotten; what failed is raised in the end.
        if task.cancelled() or task.exception():
            self._over.set()
        elif not self._over.is_set():
            self._tasks.discard(task)

    async def _follow(self) -> None:
        looks = 1
        # Python 3.11 loses a cancellation that comes as what is waited for ends.
        while looks != self._count and not self._over.is_set():
            self._take(await self._next())
            looks += 1
        self._over.set()

    async def _next(self) -> WatchedStatus | Outage:
        return await anext(self._told)

    def _take(self, told: WatchedStatus | Outage) -> None:
        """What the robot tells is the newest look; an outage leaves the status as it was."""
        if isinstance(told, WatchedStatus):
            self._look, self._received_s = Look(told.status, None, 0), time.monotonic()
        else:
            self._look = Look(self._look.status, told.error, 0)
        self._changed.set()

    async def _redraw(self) -> None:
        while not self._over.is_set():
            self._changed.clear()
            note = self._wishes.note()
            keys = self._wishes.help(self._look.status.preview) if self._keyboard else ()
            self._screen.draw(picture(self._aged(), self._robot.target, note, keys))
            await _pause(_REDRAW_EVERY_S, self._changed)

    def _aged(self) -> Look:
        silent_ms = round((time.monotonic() - self._received_s) * _MS_PER_S)
        return replace(self._look, silent_ms=silent_ms if self._look.trouble else 0)

    def _last_picture(self) -> Fitted:
        """What stays on the terminal: the keys do nothing any more."""
        return picture(self._aged(), self._robot.target)

    @contextmanager
    def _keys(self) -> Iterator[None]:
        if self._keyboard is None:
            yield
            return
        loop = asyncio.get_running_loop()
        loop.add_reader(self._keyboard.fileno, self._on_typed, self._keyboard)
        try:
            yield
        finally:
            loop.remove_reader(self._keyboard.fileno)

    def _on_typed(self, keyboard: Keyboard) -> None:
        typed = keyboard.typed()
        if typed is None:
            self._over.set()
            return
        for key in keys_in(typed):
            if key is Key.QUIT:
                self._over.set()
            elif wish := self._wishes.press(key, self._look.status.preview):
                self._begin(self._ask(wish))
        self._changed.set()

    async def _ask(self, wish: Wish) -> None:
        try:
            # What becomes of it is seen in the looks.
            if wish.enabled:
                change = await self._robot.enable_preview(wish.profile, settle_within_s=0)
            else:
                change = await self._robot.disable_preview(settle_within_s=0)
        except GatewayError as trouble:
            self._wishes.done(trouble)
        else:
            self._wishes.done(change)
        self._changed.set()

    def _on_suspend(self) -> None:
        loop = asyncio.get_running_loop()
        # Only the default action stops a program.
        loop.remove_signal_handler(signal.SIGTSTP)
        with self._screen.put_away():
            signal.raise_signal(signal.SIGTSTP)
        loop.add_signal_handler(signal.SIGTSTP, self._on_suspend)
        self._changed.set()

    def _on_continue(self) -> None:
        self._screen.take_keyboard()
        self._changed.set()


@contextmanager
def _signals(actions: Mapping[signal.Signals, Callable[[], object]]) -> Iterator[None]:
    """While the block lasts, these signals do this; what the program was told to ignore stays ignored."""
    loop = asyncio.get_running_loop()
    heard = [number for number in actions if signal.getsignal(number) is not signal.SIG_IGN]
    for number in heard:
        loop.add_signal_handler(number, actions[number])
    try:
        yield
    finally:
        for number in heard:
            loop.remove_signal_handler(number)


async def _pause(seconds: float, unless: asyncio.Event) -> None:
    """Lets time pass; ends early when the event is set."""
    try:
        async with asyncio.timeout(max(0.0, seconds)):
            await unless.wait()
    except TimeoutError:
        pass
