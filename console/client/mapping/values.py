"""Values that may be unknown, and 32-bit floats in the digits that they really have."""

import math
from typing import Final, Protocol, TypedDict, TypeVar

ValueT = TypeVar("ValueT")

_DIGITS: Final = 7
"""Significant decimal digits of an IEEE 754 binary32 (24 bits): 0.1 stays 0.1."""


class MeasuredMessage(Protocol):
    """A message that says whether its values are there and how old they are."""

    @property
    def available(self) -> bool:
        """Whether the other fields have a meaning."""

    @property
    def stale(self) -> bool:
        """Whether they are older than the robot's limit."""

    @property
    def age_ms(self) -> int:
        """Their age."""


class SampleFields(TypedDict):
    """The fields of a `Sample`."""

    available: bool
    stale: bool
    age_ms: int | None


def sample(message: MeasuredMessage) -> SampleFields:
    """Returns the fields that all measured parts share."""
    age_ms = when(message.available, message.age_ms)
    return SampleFields(available=message.available, stale=message.stale, age_ms=age_ms)


def when(known: bool, value: ValueT) -> ValueT | None:
    """Returns the value if it is known, else None."""
    return value if known else None


def number(value: float) -> float:
    """Returns a 32-bit float rounded to its significant digits."""
    return float(f"{value:.{_DIGITS}g}")


def number_when(known: bool, value: float) -> float | None:
    """Returns a 32-bit float if it is known and finite, else None."""
    return number(value) if known and math.isfinite(value) else None
