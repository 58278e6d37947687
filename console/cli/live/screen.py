"""The table on the terminal, drawn in place, and taken away while the program is suspended."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self

from rich.console import Console, RenderableType
from rich.live import Live

from console.cli.live.keyboard import Keyboard


class Screen:
    """What is drawn, and the keyboard below it, while the block lasts.

    Args:
        out: the terminal.
        keyboard: None when nobody can type.
        last: makes what stays on the terminal when the program leaves it.
    """

    def __init__(self, out: Console, keyboard: Keyboard | None, last: Callable[[], RenderableType]) -> None:
        self._out = out
        self._keyboard = keyboard
        self._last = last
        self._live = self._new_live()

    def __enter__(self) -> Self:
        if self._keyboard:
            self._keyboard.take()
        self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._leave()

    def draw(self, picture: RenderableType) -> None:
        """Replaces what is drawn."""
        self._live.update(picture, refresh=True)

    @contextmanager
    def put_away(self) -> Iterator[None]:
        """The terminal is the shell's while the block lasts."""
        self._leave()
        yield
        self.take_keyboard()
        # A new one, below whatever has been written meanwhile.
        self._live = self._new_live()
        self._live.start()

    def take_keyboard(self) -> None:
        """After a stop that nobody saw coming the shell may have changed the terminal's manners."""
        if self._keyboard:
            self._keyboard.take()

    def _leave(self) -> None:
        try:
            self._live.update(self._last())
            self._live.stop()
        finally:
            if self._keyboard:
                self._keyboard.give_back()

    def _new_live(self) -> Live:
        return Live(console=self._out, auto_refresh=False, vertical_overflow="crop")
