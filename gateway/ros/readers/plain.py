"""Numbers and names as the rest of the gateway may rely on them: finite, in range, of bounded length."""

import math
from typing import Any

# The contract's floats have 32 bits: what does not fit would leave as infinity.
_FLOAT32_MAX = 3.4028234e38
_NAME_LENGTH = 120


def finite(number: Any) -> float | None:
    """The number, or None for NaN, infinity and what no 32-bit float holds."""
    value = float(number)
    return value if math.isfinite(value) and abs(value) <= _FLOAT32_MAX else None


def finite_or_zero(number: Any) -> float:
    """The number, or 0 where the message does not know it and 0 says so."""
    return finite(number) or 0.0


def between(low: float, number: float, high: float) -> float:
    """The number, moved to the nearer end of the range when it lies outside."""
    return min(max(number, low), high)


def all_finite(*numbers: Any) -> tuple[float, ...] | None:
    """All of the numbers, or None when one of them is not finite."""
    values = tuple(value for number in numbers if (value := finite(number)) is not None)
    return values if len(values) == len(numbers) else None


def name(text: Any, length: int = _NAME_LENGTH) -> str:
    """One printable line for people, at most `length` characters.

    What was not UTF-8 on the wire, and what would move a terminal's cursor, shows as U+FFFD.
    """
    short = str(text)[:length]
    return short if short.isprintable() else "".join(map(_printable, short))


def _printable(letter: str) -> str:
    if letter.isprintable():
        return letter
    return " " if letter.isspace() else "\N{REPLACEMENT CHARACTER}"
