"""Values that may not be known, and numbers as they were meant."""

import math
from typing import TypeVar

ValueT = TypeVar("ValueT")

# A float on the wire has 24 bits: seven digits carry all of it, and 0.1 stays 0.1.
_DIGITS = 7


def when(known: bool, value: ValueT) -> ValueT | None:
    """The value where the message says that it means something, else None."""
    return value if known else None


def number(value: float) -> float:
    """A 32-bit float with the digits it really has."""
    return float(f"{value:.{_DIGITS}g}")


def number_when(known: bool, value: float) -> float | None:
    """A 32-bit float where it is known and finite, else None."""
    return number(value) if known and math.isfinite(value) else None
