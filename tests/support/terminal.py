"""What is to be seen on a terminal, from what a program wrote to it."""

import re
from typing import Final

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
