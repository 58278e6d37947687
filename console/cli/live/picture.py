"""What is drawn: the status between a headline and the keys; the middle gives way on a small terminal."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.segment import Segment
from rich.text import Text

from console.cli.live.keys import Key
from console.cli.live.wishes import Note
from console.cli.look import Look
from console.cli.tables import STYLES, headline, rows_table
from console.presentation.formatting import age, plural
from console.presentation.status_table import status_rows


@dataclass(frozen=True, slots=True)
class Fitted:
    """Three parts, one below the other, cut to the terminal's height: the middle loses its last lines.

    Args:
        head: always there.
        body: what there is room for.
        foot: always there.
    """

    head: RenderableType
    body: RenderableType
    foot: RenderableType

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Rich asks for this."""
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


def picture(
    look: Look, target: str, note: Note | None = None, keys: Iterable[tuple[Key, str, bool]] = ()
) -> Fitted:
    """A look at the robot, what became of the newest wish, and what the keys do."""
    trouble = Text()
    if look.trouble:
        old = f"NO ANSWER, the values below are {age(look.silent_ms)} old"
        trouble = Text.assemble((old, "bold red"), f" - {look.trouble.what}")
    said = Text(note.text, style=STYLES[note.style]) if note else Text()
    return Fitted(
        Group(headline(look.status, target), trouble, Text()),
        rows_table(status_rows(look.status)),
        Group(said, _help(keys)),
    )


_GAP: Final = "   "


def _help(keys: Iterable[tuple[Key, str, bool]]) -> Text:
    parts = [
        Text.assemble((key.value, "bold"), f" [{does}]" if is_so else f" {does}") for key, does, is_so in keys
    ]
    return Text(_GAP).join(parts) if parts else Text("Ctrl-C ends", style="dim")
