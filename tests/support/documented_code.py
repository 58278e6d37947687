"""The Python examples of a page: what they are and what they say they print."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

_BLOCK: Final = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
_PRINTS: Final = re.compile(r"#> (.+)$", re.MULTILINE)
DOCS: Final = Path(__file__).parents[2] / "docs"


@dataclass(frozen=True)
class Example:
    """One block of code."""

    page: str
    number: int
    code: str

    @property
    def prints(self) -> list[str]:
        """What its comments promise, in order; each is the beginning of a line or a part of it."""
        return _PRINTS.findall(self.code)


def examples(page: str) -> list[Example]:
    """All of a page, in order."""
    text = (DOCS / page).read_text(encoding="utf-8")
    found = [Example(page, number, code) for number, code in enumerate(_BLOCK.findall(text), start=1)]
    assert found, f"no example in {page}"
    return found
