"""Which of a recording's files a page has. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from common.errors import InvalidRequestError

MOST_FILES: Final = 10_000
"""Of a page, as the contract says."""
MOST_BYTES: Final = 2 * 1024 * 1024
"""Of a page's names: with sums, sizes and gaps it stays below the 4 MiB that gRPC's clients take."""


@dataclass(frozen=True, slots=True)
class FilePage:
    """Some of a recording's files, by their positions in its list. `next_token` is empty on the last page."""

    files: range
    next_token: str


def file_page(names: Sequence[str], token: str) -> FilePage:
    """Returns the page that a token leads to.

    A token is the name of the last file on the page before: files that are added meanwhile move none.

    Args:
        names: of all files, in order.
        token: of the page before; empty for the first one.

    Raises:
        InvalidRequestError: no file has that name, or none any more.
    """
    begin = _behind(names, token) if token else 0
    end, size = begin, 0
    while end < len(names) and end - begin < MOST_FILES:
        size += len(names[end].encode())
        if size > MOST_BYTES and end > begin:
            break
        end += 1
    return FilePage(range(begin, end), names[end - 1] if end < len(names) else "")


def _behind(names: Sequence[str], name: str) -> int:
    try:
        return names.index(name) + 1
    except ValueError:
        raise InvalidRequestError(
            "page_token is none that this robot has issued for this recording, or its files have changed: "
            "begin anew without one"
        ) from None
