"""The status table of `robotctl watch` on a terminal, redrawn in place."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, Self

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.live import Live
from rich.segment import Segment
from rich.text import Text

from console.cli.keyboard import Key, Keyboard
from console.cli.tables import STYLES, headline, rows_table
from console.client import GatewayError, SystemStatus
from console.presentation.formatting import age, plural
from console.presentation.preview_switch import Note
from console.presentation.status_row import View
from console.presentation.status_table import table_rows

_GAP: Final = "   "


@dataclass(frozen=True, slots=True)
class Fitted:
    """Three parts, one below the other, cut to the terminal's height: the body loses its last lines.

    Args:
        head: Always complete.
        body: As much of it as fits.
        foot: Always complete.
    """

    head: RenderableType
    body: RenderableType
    foot: RenderableType

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Renders the lines (Rich's protocol)."""
        head, body, foot = (
            console.render_lines(part, options, pad=False) for part in (self.head, self.body, self.foot)
        )
        room = max(1, console.size.height - len(head) - len(foot))
        if len(body) > room:
            more = f"... {plural(len(body) - room + 1, 'more line')}: make the window taller"
            body = [*body[: room - 1], [Segment(more[: options.max_width], console.get_style("dim"))]]
        for line in (*head, *body, *foot):
            yield from line
            yield Segment.line()


def live_view(
    status: SystemStatus,
    target: str,
    *,
    error: GatewayError | None = None,
    silent_ms: int = 0,
    message: Note | None = None,
    keys: Iterable[tuple[Key, str, bool]] = (),
) -> Fitted:
    """Returns the status table under a headline, above the newest message and the keys.

    Args:
        status: The newest that was received.
        target: The robot's address.
        error: The outage since; None while there is none.
        silent_ms: Time since the status was received.
        message: About the newest request.
        keys: Each with what it does, and whether that is in effect already.
    """
    outage = Text()
    if error:
        old = f"NO ANSWER, the values below are {age(silent_ms)} old"
        outage = Text.assemble((old, "bold red"), f" - {error.what}")
    return Fitted(
        Group(headline(status, target), outage, Text()),
        rows_table(table_rows(View(status, silent_ms=silent_ms, outdated=error is not None))),
        Group(Text(message.text, style=STYLES[message.style]) if message else Text(), _help(keys)),
    )


def _help(keys: Iterable[tuple[Key, str, bool]]) -> Text:
    parts = [
        Text.assemble((key.value, "bold"), f" [{does}]" if active else f" {does}")
        for key, does, active in keys
    ]
    return Text(_GAP).join(parts) if parts else Text("Ctrl-C ends", style="dim")


class Screen:
    """The display and the keyboard, while the block lasts.

    Args:
        out: The terminal.
        keyboard: None where there is none.
        last: Makes the view that stays on the terminal when the program leaves it.
    """

    def __init__(self, out: Console, keyboard: Keyboard | None, last: Callable[[], RenderableType]) -> None:
        self._out = out
        self._keyboard = keyboard
        self._last = last
        self._live = self._new_live()

    def __enter__(self) -> Self:
        self.take_keyboard()
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leave()

    def draw(self, view: RenderableType) -> None:
        """Replaces the displayed view."""
        self._live.update(view, refresh=True)

    @contextmanager
    def suspended(self) -> Iterator[None]:
        """Gives the terminal back to the shell while the block lasts."""
        self._leave()
        yield
        self.take_keyboard()
        # A new display, below the shell's output since.
        self._live = self._new_live()
        self._live.start()

    def take_keyboard(self) -> None:
        """Takes the keyboard, also again after a stop by SIGSTOP: the shell may have changed its mode."""
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
