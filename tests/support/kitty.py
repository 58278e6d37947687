"""A terminal that speaks the kitty keyboard protocol (https://sw.kovidgoyal.net/kitty/keyboard-protocol)."""

import re
import select
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from tests.support.robotctl import ROBOTCTL
from tests.support.terminal import Terminal

ALL_FLAGS: Final = 31
_REQUEST: Final = re.compile(
    r"\x1b\[(?:>(?P<pushed>\d+)u|(?P<popped><)u|(?P<flags>\?)u|(?P<attributes>c)|(?P<status>5)n)"
)
_ATTENTION_S: Final = 0.01


class Kitty:
    """What such a terminal answers. Pure.

    Args:
        knows: the flags that it has; others it ignores.
        speaks: whether it has the protocol; without it answers what every terminal does.
    """

    def __init__(self, knows: int = ALL_FLAGS, *, speaks: bool = True) -> None:
        self.knows, self.speaks = knows, speaks
        self.pushed: list[int] = []
        self._written = ""

    @property
    def flags(self) -> int:
        """Those in force."""
        return self.pushed[-1] & self.knows if self.pushed else 0

    def answer(self, written: str) -> str:
        """What it answers to this, which may end within a request."""
        self._written += written
        answers, end = [], 0
        for request in _REQUEST.finditer(self._written):
            end = request.end()
            if not self.speaks and not (request["attributes"] or request["status"]):
                continue
            if request["pushed"]:
                self.pushed.append(int(request["pushed"]))
            elif request["popped"]:
                self.pushed.pop()
            elif request["flags"]:
                answers.append(f"\x1b[?{self.flags}u")
            else:
                answers.append("\x1b[0n" if request["status"] else "\x1b[?62;c")
        self._written = self._written[end:]
        return "".join(answers)


class KittyTerminal(Terminal):
    """Answers by itself, as long as it is not frozen.

    Args:
        command: the program.
        knows: as `Kitty`.
        speaks: as `Kitty`.
        options: as `Terminal`.
    """

    def __init__(
        self, command: list[str], *, knows: int = ALL_FLAGS, speaks: bool = True, **options: Any
    ) -> None:
        super().__init__(command, **options)
        self.kitty = Kitty(knows, speaks=speaks)
        self._lock = threading.Lock()
        self._answered = 0
        self._thawed, self._ending = threading.Event(), threading.Event()
        self._thawed.set()
        self._thread = threading.Thread(target=self._answer, name="kitty", daemon=True)
        self._thread.start()

    def freeze(self) -> None:
        """Neither reads nor answers any more."""
        self._thawed.clear()

    def thaw(self) -> None:
        """Answers what was requested meanwhile, and goes on."""
        self._thawed.set()

    def read(self) -> str:
        """What was drawn so far."""
        with self._lock:
            return super().read()

    def close(self) -> None:
        """Ends the program if it still runs."""
        self._ending.set()
        self._thawed.set()
        self._thread.join()
        super().close()

    def _answer(self) -> None:
        while not self._ending.is_set():
            self._thawed.wait()
            select.select([self._master], [], [], _ATTENTION_S)
            drawn = self.read()
            answer = self.kitty.answer(drawn[self._answered :])
            self._answered = len(drawn)
            if answer:
                self.press(answer)


@contextmanager
def kitty_with(command: list[str], **options: Any) -> Iterator[KittyTerminal]:
    """Any program on such a terminal, gone when the block ends; options as `KittyTerminal`."""
    screen = KittyTerminal(command, **options)
    try:
        yield screen
    finally:
        screen.close()


@contextmanager
def robotctl_on_kitty(*words: str, **options: Any) -> Iterator[KittyTerminal]:
    """The operator's program on such a terminal; options as `KittyTerminal`."""
    with kitty_with([str(ROBOTCTL), *words], **options) as screen:
        yield screen
