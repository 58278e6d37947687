"""The command blocks of a page, and why some of them are not run.

A comment above a block says so: "not run: REASON" for the whole of it, "not run `BEGINNING`: REASON" for the
lines that begin so.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
PAGES: Final = (
    "README.md",
    "docs/robotctl.md",
    "docs/configuration.md",
    "docs/security.md",
    "docs/deploy.md",
    "docs/client.md",
)
_NOT_COMMANDS: Final = ("python", "yaml", "toml", "json", "text")
_MARK: Final = re.compile(r"\s*<!-- not run(?: `(?P<beginning>[^`]+)`)?: (?P<reason>.+) -->")
_SPAN: Final = re.compile(r"`([^`\n]+(?:\n[^`\n]+)?)`")
"""Code within a line, or within two: prose is wrapped."""


@dataclass(frozen=True)
class Block:
    """One block of commands."""

    page: str
    line: int
    text: str
    reason: str = ""
    """Why it is not run; empty: it is."""
    whole: str = ""
    """With the lines that are not run."""

    @property
    def name(self) -> str:
        return f"{self.page}:{self.line}"


def blocks(page: str) -> Iterator[Block]:
    """All blocks of commands of a page, in order."""
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    mark: re.Match[str] | None = None
    number = 0
    while number < len(lines):
        line = lines[number]
        begin = number
        number += 1
        if found := _MARK.fullmatch(line):
            mark = found
        elif line.lstrip().startswith("```"):
            indent = len(line) - len(line.lstrip())
            while not lines[number].lstrip().startswith("```"):
                number += 1
            body = [each[indent:] for each in lines[begin + 1 : number]]
            number += 1
            if line.strip().removeprefix("```") not in _NOT_COMMANDS:
                yield _block(page, begin + 2, body, mark)
            mark = None
        elif line.startswith("    ") and not lines[begin - 1].strip():
            while number < len(lines) and lines[number].startswith("    "):
                number += 1
            yield _block(page, begin + 1, [each[4:] for each in lines[begin:number]], mark)
            mark = None
        elif line.strip():
            mark = None


def typed(page: str) -> Iterator[str]:
    """Yields what a page has one type: code within the text, and lines of blocks, without comments."""
    for span in _SPAN.findall((ROOT / page).read_text(encoding="utf-8")):
        yield " ".join(span.replace("\\|", "|").split())
    for block in blocks(page):
        if "synopsis" not in block.reason:
            for line in block.whole.splitlines():
                yield line.partition(" #")[0]


def _block(page: str, line: int, body: list[str], mark: re.Match[str] | None) -> Block:
    reason, whole = "", "\n".join(body)
    if mark and mark["beginning"]:
        kept = [each for each in body if not each.startswith(mark["beginning"])]
        assert len(kept) < len(body), f"{page}:{line} has no line that begins with {mark['beginning']}"
        body = kept
    elif mark:
        reason = mark["reason"]
    return Block(page, line, "\n".join(body), reason, whole)
