"""A terminal for a program under test: what is typed, what is to be seen, and the manners it is left with."""

import codecs
import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from tests.support.robotctl import ROBOTCTL, environment
from tests.support.waiting import wait_until

_PIECE: Final = re.compile(r"\x1b\[(?P<numbers>[?\d;]*)(?P<final>[A-Za-z])|(?P<text>[^\x1b])", re.DOTALL)


def seen(written: str) -> list[str]:
    """The lines that a terminal shows; knows no more of a terminal's language than our programs speak."""
    lines: list[list[str]] = [[]]
    row = column = 0
    end = 0
    for piece in _PIECE.finditer(written):
        assert piece.start() == end, f"not understood: {written[end : end + 20]!r}"
        end = piece.end()
        match piece["final"], piece["text"]:
            case None, "\r":
                column = 0
            case None, "\n":
                row += 1
                lines += [[]] * (row + 1 - len(lines))
            case None, text:
                before = [*lines[row][:column], *(" " * (column - len(lines[row])))]
                lines[row] = [*before, text, *lines[row][column + 1 :]]
                column += 1
            case "A", _:
                row = max(0, row - int(piece["numbers"] or 1))
            case "K", _:
                assert piece["numbers"] == "2", piece[0]
                lines[row] = []
            case "m" | "h" | "l", _:
                pass  # Colours; the cursor shown or hidden.
            case _:
                raise AssertionError(f"not understood: {piece[0]!r}")
    return ["".join(line).rstrip() for line in lines]


class Terminal:
    """A program that has a terminal of its own, as its controlling terminal; everything it drew is kept.

    Args:
        command: the program.
        rows: height.
        columns: width.
        typing: whether standard input is the terminal, too; else it is empty.
        extra: for its environment.
    """

    def __init__(
        self,
        command: list[str],
        *,
        rows: int = 40,
        columns: int = 100,
        typing: bool = True,
        extra: dict[str, str] | None = None,
    ) -> None:
        self.drawn = ""
        self._decoder = codecs.getincrementaldecoder("utf-8")()
        """Keeps the beginning of a character of which the rest was not written yet."""
        # The second end stays open, so that the terminal outlives the program.
        self._master, self._slave = pty.openpty()
        self.resize(rows, columns)
        os.set_blocking(self._master, False)
        self.manners_before = self.manners()
        self.process = subprocess.Popen(
            # setsid makes this its controlling terminal: Ctrl-C arrives as it does in a shell.
            ["setsid", "--ctty", *command] if typing else ["setsid", *command],
            stdin=self._slave if typing else subprocess.DEVNULL,
            stdout=self._slave,
            stderr=self._slave,
            env=environment(TERM="xterm-256color", **(extra or {})),
        )

    def resize(self, rows: int, columns: int) -> None:
        """As when the window is dragged."""
        fcntl.ioctl(self._slave, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def manners(self) -> list[Any]:
        """Its modes: whether it shows what is typed, waits for whole lines, makes signals of keys ..."""
        return termios.tcgetattr(self._slave)

    def key_by_key(self) -> bool:
        """Whether typed keys go to the program at once and unseen."""
        return not self.manners()[3] & (termios.ICANON | termios.ECHO)

    def read(self) -> str:
        """What was drawn so far."""
        while select.select([self._master], [], [], 0)[0]:
            data = os.read(self._master, 65536)
            if not data:
                break
            self.drawn += self._decoder.decode(data)
        return self.drawn

    def lines(self) -> list[str]:
        """What is to be seen."""
        return seen(self.read())

    def wait_for(self, text: str, *, after: int = 0) -> int:
        """Waits until this was drawn, from a place in `drawn` on; the place behind it."""
        wait_until(lambda: text in self.read()[after:], f"{text!r} is on the screen", 30)
        return self.drawn.index(text, after) + len(text)

    def wait_to_see(self, text: str) -> None:
        """Waits until this is to be seen on one line."""
        wait_until(lambda: any(text in line for line in self.lines()), f"{text!r} is to be seen", 30)

    def press(self, keys: str) -> None:
        """As typed."""
        os.write(self._master, keys.encode())

    def pull_away(self) -> None:
        """As when its window is closed."""
        for end in (self._slave, self._master):
            os.close(end)
        self._slave = self._master = -1

    def close(self) -> None:
        """Ends the program if it still runs."""
        self.process.kill()
        self.process.wait()
        if self._master >= 0:
            self.pull_away()


@contextmanager
def terminal_with(command: list[str], **options: Any) -> Iterator[Terminal]:
    """Any program on a terminal, gone when the block ends; options as `Terminal`."""
    screen = Terminal(command, **options)
    try:
        yield screen
    finally:
        screen.close()


@contextmanager
def robotctl_on_terminal(*words: str, **options: Any) -> Iterator[Terminal]:
    """The operator's program on a terminal."""
    with terminal_with([str(ROBOTCTL), *words], **options) as screen:
        yield screen
