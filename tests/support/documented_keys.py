"""The keys that a page of the documents lists."""

import re
from pathlib import Path
from typing import Final

_DOCS: Final = Path(__file__).parents[2] / "docs"


def documented_keys(page: str, heading: str) -> set[str]:
    """Returns the names in the first table of keys below a heading, each key of a range on its own."""
    text = (_DOCS / page).read_text(encoding="utf-8")
    chapter = text.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    table = chapter.partition("| key | does |\n|---|---|\n")[2].partition("\n\n")[0]
    names: set[str] = set()
    for row in table.splitlines():
        for name in re.split(r"[,;] ", row.split("|")[1].strip()):
            if found := re.fullmatch(r"(.+)(\d) to \1(\d)", name):
                names |= {f"{found[1]}{number}" for number in range(int(found[2]), int(found[3]) + 1)}
            else:
                names.add(name)
    assert names, f"{page} has no table of keys below '{heading}'"
    return names
