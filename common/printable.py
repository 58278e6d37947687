"""Text from outside, made safe for a terminal and for a log of one line per record.

A terminal obeys control characters (ECMA-48): an escape sequence sets its title or writes the clipboard (OSC
52), a line feed forges a line of a log, and bidirectional overrides reorder what is read (Unicode UAX #9).
"""

import json
import re
from typing import Final

# C0, DEL and C1; surrogates; line and paragraph separator; what is invisible or reorders text. Not the
# joiners U+200C and U+200D, which several scripts need.
_UNPRINTABLE: Final = re.compile(
    "[\x00-\x1f\x7f-\x9f\ud800-\udfff\u061c\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\U000e0000-\U000e007f]"
)


def printable(text: str) -> str:
    """Returns the text with a space for each character that a terminal does not print but obeys."""
    return text if text.isprintable() else _UNPRINTABLE.sub(" ", text)


def printable_lines(text: str) -> str:
    """Returns the same for a text of several lines: line feeds stay."""
    return "\n".join(printable(line) for line in text.split("\n"))


def escaped(json_text: str) -> str:
    """Returns a JSON text with escape sequences (RFC 8259 7) for these characters; line feeds stay."""
    return "\n".join(
        _UNPRINTABLE.sub(lambda found: json.dumps(found[0])[1:-1], line) for line in json_text.split("\n")
    )
