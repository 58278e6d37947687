"""Sanitises numbers and texts of messages: finite, in range, of bounded length."""

import math
from typing import Any

# IEEE 754 binary32, the contract's float: larger numbers would become infinity.
_FLOAT32_MAX = 3.4028234e38
_MAX_NAME_LENGTH = 120


def finite(number: Any) -> float | None:
    """Returns the number; None for NaN, infinity and what a 32-bit float can't hold."""
    value = float(number)
    return value if math.isfinite(value) and abs(value) <= _FLOAT32_MAX else None


def finite_or_zero(number: Any) -> float:
    """Returns the number; 0 if it is not finite, for fields whose unknown value is 0."""
    return finite(number) or 0.0


def clamp(low: float, number: float, high: float) -> float:
    """Returns the number, or the nearer end of the range if it lies outside."""
    return min(max(number, low), high)


def all_finite(*numbers: Any) -> tuple[float, ...] | None:
    """Returns the numbers; None if one of them is not finite."""
    values = tuple(value for number in numbers if (value := finite(number)) is not None)
    return values if len(values) == len(numbers) else None


def one_line(text: Any, max_length: int = _MAX_NAME_LENGTH) -> str:
    """Returns one printable line.

    Invalid UTF-8, and characters that would move a terminal's cursor, are replaced by U+FFFD.
    """
    short = str(text)[:max_length]
    return short if short.isprintable() else "".join(map(_printable, short))


def _printable(letter: str) -> str:
    if letter.isprintable():
        return letter
    return " " if letter.isspace() else "\N{REPLACEMENT CHARACTER}"
