"""The tables of docs/robotctl.md as data: which keys `robotctl --json` prints, and of what type."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

DOCS: Final = Path(__file__).parents[2] / "docs/robotctl.md"
_ROW: Final = re.compile(r"^\| `(?P<key>[^`]+)` \| (?P<type>[^|]+) \|")
_CHOICE: Final = re.compile(r"\{([^}]+)\}")
_TYPES: Final[Mapping[str, tuple[type, ...]]] = {
    "string": (str,),
    "integer": (int,),
    "number": (int, float),
    "boolean": (bool,),
    "object": (dict,),
    "array": (list,),
    "null": (type(None),),
    # Described by a section of its own.
    "status": (dict,),
    "preview": (dict,),
    "teleop": (dict,),
    "recording": (dict,),
    "event": (dict,),
}


@dataclass(frozen=True)
class Type:
    """What a key's value may be, in the words of the page."""

    words: str

    def allows(self, value: object) -> bool:
        """Whether the value is of this type."""
        names = self.words.split(" or ")
        if listed := re.findall(r'"([^"]+)"', self.words):
            return value in listed or (value is None and names[-1] == "null")
        if isinstance(value, bool):
            return "boolean" in names
        return isinstance(value, tuple(kind for name in names for kind in _TYPES[name]))


Documented = Mapping[str, Type]


@cache
def documented(section: str) -> Documented:
    """The keys of a section, with those of the sections it refers to."""
    text = DOCS.read_text(encoding="utf-8")
    body = text.partition(f"\n### {section}\n")[2].partition("\n#")[0]
    rows = [match for line in body.splitlines() if (match := _ROW.match(line))]
    assert rows, f"no section '{section}'"
    said: dict[str, Type] = {}
    for row in rows:
        for key in spelt_out(row["key"]):
            said[key] = Type(row["type"].strip())
    return said | _referred(said)


def holds(said: Documented, document: object, *, complete: bool) -> None:
    """Asserts that a document has no key or type but the documented ones; a complete one has all of them."""
    found = leaves(document)
    unknown = sorted(found.keys() - said.keys())
    assert unknown == [], "keys without a line in docs/robotctl.md"
    for key, values in found.items():
        for value in values:
            assert said[key].allows(value), f"{key}: {value!r} is not {said[key].words}"
    if complete:
        parts = {key for key in said if any(other.startswith((f"{key}.", f"{key}[")) for other in said)}
        assert found.keys() >= said.keys() - parts, "documented keys that don't come"


def leaves(document: object, above: str = "") -> dict[str, list[object]]:
    """Each key of a document with the values found there; `[]` stands for any item of an array."""
    found: dict[str, list[object]] = {}
    inner: list[tuple[str, Any]] = []
    if isinstance(document, dict) and above != "configuration":
        inner = [(f"{above}.{key}" if above else key, value) for key, value in document.items()]
    elif isinstance(document, list) and any(isinstance(item, dict) for item in document):
        inner = [(f"{above}[]", item) for item in document]
    if not inner:
        return {above: [document]} if above else {}
    for key, value in inner:
        for leaf, values in leaves(value, key).items():
            found.setdefault(leaf, []).extend(values)
    return found


def spelt_out(key: str) -> list[str]:
    """`a.{b,c}.d` is two keys."""
    choice = _CHOICE.search(key)
    if not choice:
        return [key]
    return [key.replace(choice[0], one) for one in choice[1].split(",")]


def _referred(said: Documented) -> dict[str, Type]:
    more: dict[str, Type] = {}
    for key, kind in said.items():
        if kind.words.startswith("status"):
            more |= {f"{key}.{inner}": type_ for inner, type_ in documented("status --json").items()}
        elif kind.words == "recording":
            more |= {f"{key}.{inner}": type_ for inner, type_ in documented("record show --json").items()}
        elif kind.words == "event":
            said_of_events = documented("events --json").items()
            inner_keys = {inner: type_ for inner, type_ in said_of_events if inner.startswith("event.")}
            more |= {f"{key}.{inner.removeprefix('event.')}": type_ for inner, type_ in inner_keys.items()}
        elif kind.words in {"preview", "teleop"} or (key, kind.words) == ("gateway", "object"):
            status = documented("status --json")
            more |= {inner: type_ for inner, type_ in status.items() if inner.startswith(f"{key}.")}
    return more
