"""What the configuration says of a generic value: its unit, and which values are bad. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from gateway.status.fault import Severity
from gateway.status.limit import Limit


class Side(Enum):
    """On which side of its limits a number is."""

    LOW = "low"
    HIGH = "high"


@dataclass(frozen=True, slots=True)
class Violation:
    """A number beyond a limit: on which side, how bad, and which limit that is."""

    side: Side
    severity: Severity
    limit: Limit


@dataclass(frozen=True, slots=True)
class NumberMeaning:
    """What is known of a number.

    Attributes:
        unit: "°C" for example; empty for a number without one.
        decimals: digits behind the point that it is rounded to; None: as it is received.
        warning_below: lower limits that are broken by small values.
        error_below: the same, for an error.
        warning_above: upper limits that are broken by large values.
        error_above: the same, for an error.
        remedy: what to do when a limit is broken; empty for a general sentence.
        tile: whether operators' windows show it over the picture, too.
    """

    unit: str = ""
    decimals: int | None = None
    warning_below: Limit | None = None
    error_below: Limit | None = None
    warning_above: Limit | None = None
    error_above: Limit | None = None
    remedy: str = ""
    tile: bool = False

    def violation(self, value: float, before: Mapping[Side, Severity]) -> Violation | None:
        """Returns the limit that a value violates, the more severe one of two; None if it is good.

        Args:
            value: to judge.
            before: the previous verdict, which hysteresis needs; empty if the value was good.
        """
        for side, severity, limit in self._limits():
            known = before.get(side)
            was_broken = known is not None and known.rank >= severity.rank
            if limit is not None and limit.broken(value, was_broken=was_broken):
                return Violation(side, severity, limit)
        return None

    def limit(self, side: Side, severity: Severity) -> Limit | None:
        """Returns the limit of a side and severity; None if there is none."""
        return next((limit for *found, limit in self._limits() if found == [side, severity]), None)

    def _limits(self) -> tuple[tuple[Side, Severity, Limit | None], ...]:
        return (
            (Side.HIGH, Severity.ERROR, self.error_above),
            (Side.LOW, Severity.ERROR, self.error_below),
            (Side.HIGH, Severity.WARNING, self.warning_above),
            (Side.LOW, Severity.WARNING, self.warning_below),
        )


@dataclass(frozen=True, slots=True)
class TextMeaning:
    """What is known of a text.

    Attributes:
        levels: severities of texts, None of those that are good.
        other: severity of every other text; None if they are good.
        remedy: what to do about a bad one; empty for a general sentence.
        tile: as of a number.
    """

    levels: tuple[tuple[str, Severity | None], ...] = ()
    other: Severity | None = None
    remedy: str = ""
    tile: bool = False

    def severity(self, text: str) -> Severity | None:
        """Returns how bad a text is; None if it is good."""
        return dict(self.levels).get(text, self.other)

    def is_listed(self, text: str) -> bool:
        """Whether the configuration has a level of exactly this text."""
        return any(text == listed for listed, _ in self.levels)


ANY_NUMBER: Final = NumberMeaning()
"""Of a number without unit and limits."""
ANY_TEXT: Final = TextMeaning()
"""Of a text of which every value is good."""
