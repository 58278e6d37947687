"""robotctl watch on a terminal: statuses, keys, signals and answers to requests, all in one asyncio loop.

Nothing blocks it: a key never delays a redraw, and a robot that does not answer never delays a key.
"""

import asyncio
import signal
import time
from collections.abc import Coroutine, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Final

from common.tasks import cancel
from console.cli.keyboard import Key, Keyboard, has_keyboard, keys_in
from console.cli.live_screen import Fitted, Screen, live_view
from console.cli.loop_signals import ENDING, handled
from console.cli.preview_keys import PreviewKeys
from console.cli.session import Session
from console.client import DesiredPreview, GatewayError, Outage, WatchedStatus

_MS_PER_S: Final = 1000
# Messages expire, and ages count up, between two statuses as well.
_REDRAW_EVERY_S: Final = 1.0


def watch_on_a_terminal(session: Session, interval_s: float, count: int | None) -> None:
    """Shows the status, updated at most every `interval_s`, until q or a signal, or for `count` updates.

    Raises:
        GatewayError: No status came at all. A later outage is shown instead.
    """
    asyncio.run(_LiveWatch(session, interval_s, count).run())


class _LiveWatch:
    """One run."""

    def __init__(self, session: Session, interval_s: float, count: int | None) -> None:
        self._session = session
        self._interval_s = interval_s
        self._count = count
        self._preview_keys = PreviewKeys()
        self._keyboard = Keyboard() if has_keyboard() else None
        self._ending = asyncio.Event()
        self._changed = asyncio.Event()
        self._tasks: set[asyncio.Task[None]] = set()
        self._error: GatewayError | None = None

    async def run(self) -> None:
        """Runs until it is ended."""
        with handled(dict.fromkeys(ENDING, self._ending.set)):
            async with self._session.connect_async() as self._robot:
                self._stream = self._robot.watch_status(self._interval_s)
                if await self._first_status():
                    await self._show()

    async def _first_status(self) -> bool:
        reading = asyncio.create_task(self._next())
        ending = asyncio.create_task(self._ending.wait())
        try:
            await asyncio.wait((reading, ending), return_when=asyncio.FIRST_COMPLETED)
            if not reading.done():
                return False
            self._take(reading.result())
            return True
        finally:
            for task in (reading, ending):
                task.cancel()

    async def _show(self) -> None:
        # What stays on the terminal is without the keys, which have no effect any more.
        self._screen = Screen(self._session.out, self._keyboard, self._view)
        signals = {
            signal.SIGTSTP: self._on_suspend,
            signal.SIGCONT: self._on_continue,
            signal.SIGWINCH: self._changed.set,
        }
        with self._screen, handled(signals), self._keys():
            self._start(self._read())
            self._start(self._redraw())
            try:
                await self._ending.wait()
            finally:
                ended = await cancel(self._tasks)
        for outcome in ended:
            if isinstance(outcome, Exception):
                raise outcome

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._on_end_of)

    def _on_end_of(self, task: "asyncio.Task[None]") -> None:
        # A finished request is dropped; a failed task ends the program, which raises its error.
        if task.cancelled() or task.exception():
            self._ending.set()
        elif not self._ending.is_set():
            self._tasks.discard(task)

    async def _read(self) -> None:
        received = 1
        # Python 3.11 loses a cancellation that coincides with the end of what is awaited.
        while received != self._count and not self._ending.is_set():
            self._take(await self._next())
            received += 1
        self._ending.set()

    async def _next(self) -> WatchedStatus | Outage:
        return await anext(self._stream)

    def _take(self, item: WatchedStatus | Outage) -> None:
        if isinstance(item, WatchedStatus):
            self._status, self._error, self._received_s = item.status, None, time.monotonic()
        else:
            self._error = item.error
        self._changed.set()

    async def _redraw(self) -> None:
        while not self._ending.is_set():
            self._changed.clear()
            keys = self._preview_keys.help(self._status.preview) if self._keyboard else ()
            self._screen.draw(self._view(message=self._preview_keys.message(), keys=keys))
            with suppress(TimeoutError):
                async with asyncio.timeout(_REDRAW_EVERY_S):
                    await self._changed.wait()

    def _view(self, **parts: Any) -> Fitted:
        silent_ms = round((time.monotonic() - self._received_s) * _MS_PER_S)
        return live_view(self._status, self._robot.target, error=self._error, silent_ms=silent_ms, **parts)

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
            self._ending.set()
            return
        for key in keys_in(typed):
            if key is Key.QUIT:
                self._ending.set()
            elif request := self._preview_keys.press(key, self._status.preview):
                self._start(self._send(request))
        self._changed.set()

    async def _send(self, request: DesiredPreview) -> None:
        try:
            # The statuses show how it goes on.
            change = await self._robot.set_preview(request, settle_within_s=0)
        except GatewayError as error:
            self._preview_keys.done(error)
        else:
            self._preview_keys.done(change)
        self._changed.set()

    def _on_suspend(self) -> None:
        loop = asyncio.get_running_loop()
        # Only the default action stops a program.
        loop.remove_signal_handler(signal.SIGTSTP)
        with self._screen.suspended():
            signal.raise_signal(signal.SIGTSTP)
        loop.add_signal_handler(signal.SIGTSTP, self._on_suspend)
        self._changed.set()

    def _on_continue(self) -> None:
        self._screen.take_keyboard()
        self._changed.set()
