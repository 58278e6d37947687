"""Keys of the generic kinds of `sources`: which keys each kind has, and how they fit together."""

import re
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field

from gateway.config.faults import LowerLimit, UpperLimit
from gateway.status.fault import Severity
from gateway.status.meaning import TextMeaning

MOST_GENERIC: Final = 64
"""Generic sources of one gateway: each is a subscription, and a row for the operator."""
MOST_TILES: Final = 6
"""Tiles that a window shows over its picture; of more the first ones."""
_LABEL: Final = re.compile(r"[a-z][a-z0-9_]{0,39}")
_LONGEST_PATH: Final = 200
_MOST_STEPS: Final = 16
_PATH: Final = re.compile(r"[A-Za-z]\w*(\[\d{1,5}\])?(\.[A-Za-z]\w*(\[\d{1,5}\])?)*", re.ASCII)
LONGEST_TEXT: Final = 300
MOST_WORDS: Final = 64
"""Names of numbers, and texts with a level, of one source."""
_LONGEST_TITLE: Final = 40
_LONGEST_UNIT: Final = 12
_LONGEST_REMEDY: Final = 200

_BOTH: Final = frozenset({"number", "text"})
_NUMBER: Final = frozenset({"number"})
_TEXT: Final = frozenset({"text"})
KINDS_OF_KEY: Final[Mapping[str, frozenset[str]]] = {
    **dict.fromkeys(("title", "field", "remedy", "tile"), _BOTH),
    **dict.fromkeys(("unit", "scale", "offset", "decimals"), _NUMBER),
    **dict.fromkeys(("warning_below", "error_below", "warning_above", "error_above"), _NUMBER),
    **dict.fromkeys(("max_length", "names", "levels", "other_level"), _TEXT),
}
"""Keys that only some kinds have; with another kind they would do nothing."""


def _path(path: str) -> str:
    if not _PATH.fullmatch(path) or len(path) > _LONGEST_PATH or path.count(".") >= _MOST_STEPS:
        raise ValueError(
            "a field of the message, temperature, pose.position.z or cells[2].voltage for example"
        )
    return path


def _printable(longest: int) -> AfterValidator:
    def check(text: str) -> str:
        if not text.isprintable() or text != text.strip() or len(text) > longest:
            raise ValueError(f"printable text of at most {longest} characters, without blanks at its ends")
        return text

    return AfterValidator(check)


FieldPath = Annotated[
    str,
    AfterValidator(_path),
    Field(json_schema_extra={"pattern": f"^{_PATH.pattern}$", "maxLength": _LONGEST_PATH}),
]
"""Names of fields with points between them; an index in brackets chooses an item of a list."""
Title = Annotated[str, _printable(_LONGEST_TITLE)]
Unit = Annotated[str, _printable(_LONGEST_UNIT)]
Remedy = Annotated[str, _printable(_LONGEST_REMEDY)]
Word = Annotated[str, _printable(LONGEST_TEXT)]
Level = Literal["good", "warning", "error"]
_SEVERITIES: Final[Mapping[Level, Severity | None]] = {
    "good": None,
    "warning": Severity.WARNING,
    "error": Severity.ERROR,
}


def check_generic_label(kind: str, label: str | None) -> None:
    """Raises ValueError unless the label can be one of a generic kind."""
    if label is None or not _LABEL.fullmatch(label):
        raise ValueError(
            f"a source of kind '{kind}' has a label of its own: at most 40 small letters, digits and _, "
            "label: motor_temperature for example"
        )


def check_keys(kind: str, changed: Mapping[str, Any]) -> None:
    """Raises ValueError if one of the keys belongs to other kinds, or one that the kind needs is missing.

    Args:
        kind: of the source.
        changed: the keys that differ from their defaults, with their values.
    """
    for key in changed:
        kinds = KINDS_OF_KEY.get(key)
        if kinds and kind not in kinds:
            raise ValueError(
                f"a source of kind '{kind}' has no key '{key}', which is of kind {' or '.join(sorted(kinds))}"
            )
    if kind in KINDS_OF_KEY["field"] and "field" not in changed:
        raise ValueError(f"a source of kind '{kind}' needs 'field', the field of the message that it shows")


def check_order(
    lower: tuple[LowerLimit | None, LowerLimit | None], upper: tuple[UpperLimit | None, UpperLimit | None]
) -> None:
    """Raises ValueError unless there are good values, and an error lies beyond its warning.

    Args:
        lower: error_below and warning_below.
        upper: error_above and warning_above.
    """
    (error_below, warning_below), (error_above, warning_above) = lower, upper
    if error_below and warning_below and not error_below.raise_at < warning_below.raise_at:
        raise ValueError("error_below.raise_at must be below warning_below.raise_at")
    if error_below and warning_below and error_below.clear_at > warning_below.clear_at:
        raise ValueError("error_below.clear_at must not be above warning_below.clear_at")
    if error_above and warning_above and not error_above.raise_at > warning_above.raise_at:
        raise ValueError("error_above.raise_at must be above warning_above.raise_at")
    if error_above and warning_above and error_above.clear_at < warning_above.clear_at:
        raise ValueError("error_above.clear_at must not be below warning_above.clear_at")
    below = [limit.clear_at for limit in lower if limit]
    above = [limit.clear_at for limit in upper if limit]
    if below and above and max(below) >= min(above):
        raise ValueError(
            f"no value is good: low values are good from {max(below):g} on, high ones up to {min(above):g}"
        )


def text_meaning(levels: Mapping[str, Level], other: Level, remedy: str, *, tile: bool) -> TextMeaning:
    """Returns the levels in the form that the fault rules take."""
    listed = tuple((text, _SEVERITIES[level]) for text, level in levels.items())
    return TextMeaning(listed, _SEVERITIES[other], remedy, tile)


def check_words(words: Iterable[str], max_length: int) -> None:
    """Raises ValueError if one of the words of `names` or `levels` is longer than texts may be."""
    for word in words:
        if len(word) > max_length:
            raise ValueError(f"'{word}' is longer than texts may be: max_length is {max_length}")
