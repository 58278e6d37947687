"""Which events are listed, and their text in a file."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Final

from console.monitor.event_log import EventLine
from console.presentation.formatting import wall_clock
from console.presentation.severity_style import SeverityStyle

_SEVERITIES: Final = {SeverityStyle.BAD: "error", SeverityStyle.WARNING: "warning"}


class AtLeast(Enum):
    """Severity from which on events are listed; the values are for people."""

    ALL = "All events"
    WARNINGS = "Warnings, errors"
    ERRORS = "Errors"


_LISTED: Final = {
    AtLeast.WARNINGS: (SeverityStyle.WARNING, SeverityStyle.BAD),
    AtLeast.ERRORS: (SeverityStyle.BAD,),
}


@dataclass(frozen=True, slots=True)
class EventFilter:
    """Severity and words that an event must have, and whether it may be about clients.

    Args:
        at_least: the severity.
        words: separated by spaces; each of them must occur, in any case of letters.
        presence: whether to list who joins and leaves.
    """

    at_least: AtLeast = AtLeast.ALL
    words: str = ""
    presence: bool = False

    def lists(self, line: EventLine) -> bool:
        """Whether a line is listed."""
        if self.at_least is not AtLeast.ALL and line.style not in _LISTED[self.at_least]:
            return False
        if line.presence and not self.presence:
            return False
        text = line.text.casefold()
        return all(word in text for word in self.words.casefold().split())


def as_json_lines(lines: Iterable[EventLine]) -> str:
    """Returns events as JSON, one on each line, in the given order."""
    return "".join(f"{json.dumps(_form(line), ensure_ascii=False)}\n" for line in lines)


def _form(line: EventLine) -> dict[str, object]:
    return {
        "at": wall_clock(round(line.at_s * 1000), form="%Y-%m-%dT%H:%M:%S%z"),
        "severity": _SEVERITIES.get(line.style, "info"),
        "by": "monitor" if line.own else "robot",
        "text": line.text,
    }
