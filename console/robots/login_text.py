"""The form of a login: a first line, values on lines of their own, and blocks of several lines.

# Robot Gateway login 1
name: anna
authority:
-----BEGIN CERTIFICATE-----
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

_LARGEST: Final = 64 * 1024


@dataclass(frozen=True, slots=True)
class LoginText:
    """The content of a login.

    Args:
        words: Values by their keys.
        blocks: Blocks by their keys, each line with its line feed.
    """

    words: dict[str, str]
    blocks: dict[str, str]


def parse_login_text(
    text: str, head: str, words: Collection[str], blocks: Collection[str]
) -> LoginText | None:
    """Returns the content of a text of at most 64 KiB; None if it does not begin as such a login.

    Args:
        text: Of unknown origin.
        head: The first line.
        words: Keys of values. Lines with other keys are left out.
        blocks: Keys of blocks.
    """
    lines = text[:_LARGEST].splitlines()
    if not lines or lines[0].strip() != head:
        return None
    values: dict[str, str] = {}
    parts: dict[str, list[str]] = {}
    part: list[str] | None = None
    for line in lines[1:]:
        key, colon, value = line.partition(":")
        if colon and key in words:
            values[key], part = value.strip(), None
        elif colon and key in blocks and not value.strip():
            part = parts[key] = []
        elif part is not None:
            part.append(line)
    return LoginText(values, {key: "\n".join(those) + "\n" for key, those in parts.items()})
