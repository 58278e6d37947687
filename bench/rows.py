"""A row: a figure of ours, round by round, its reference in the same rounds, and the promised limit."""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, Self

FEWEST_ROUNDS: Final = 5
_SIGNIFICANT_DIGITS: Final = 6


class MeasurementError(Exception):
    """The rounds do not make a row: too few, unpaired, or a reference of 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One measured figure.

    Args:
        name: fixed, "ros.intake" for example; the first part is the group.
        what: one line for people: what was measured, and against what.
        unit: of values and references; empty for a count.
        values: what our product needed, one figure per round.
        references: what the reference needed in the same rounds. Empty where the bar is on the value itself.
        bar: the promised limit, on the ratio where there is a reference, else on the value. None: published
            for comparison, without a promise.
        better: "lower": at most the bar keeps the promise; "higher": at least the bar does.
        judged: "median" of the rounds; the "worst" of them where the promise is about every one (with a
            reference: the round with the worst ratio); their "sum", which has no reference, where it is about
            all together.
        discarded: rounds that were measured and left out, because they were not comparable.
        single: whether one long round is all there is (a soak).

    Raises:
        MeasurementError: fewer than FEWEST_ROUNDS rounds, references that do not pair with them or with
            `judged`, or a reference that is not above 0, with which a ratio means nothing.
    """

    name: str
    what: str
    unit: str
    values: Sequence[float]
    bar: float | None
    references: Sequence[float] = ()
    better: Literal["lower", "higher"] = "lower"
    judged: Literal["median", "worst", "sum"] = "median"
    discarded: int = 0
    single: bool = False

    def __post_init__(self) -> None:
        if len(self.values) < (1 if self.single else FEWEST_ROUNDS):
            raise MeasurementError(f"{self.name}: {len(self.values)} rounds are too few")
        if self.references and len(self.references) != len(self.values):
            raise MeasurementError(f"{self.name}: every round needs its reference")
        if self.references and self.judged == "sum":
            raise MeasurementError(f"{self.name}: a sum of rounds has no reference")
        if any(reference <= 0 for reference in self.references):
            raise MeasurementError(f"{self.name}: a reference of 0 makes no ratio")

    @property
    def value(self) -> float:
        """What is judged of our rounds."""
        if self.judged == "median":
            return self.median
        if self.judged == "sum":
            return sum(self.values)
        return self.values[self._worst_round]

    @property
    def median(self) -> float:
        """Median round of ours, however the row is judged."""
        return statistics.median(self.values)

    @property
    def reference(self) -> float | None:
        """What `value` is judged against: of the reference, the median round or the one beside the worst."""
        if not self.references:
            return None
        if self.judged == "median":
            return statistics.median(self.references)
        return self.references[self._worst_round]

    @property
    def ratio(self) -> float | None:
        """Value by reference."""
        return None if self.reference is None else self.value / self.reference

    @property
    def spread(self) -> tuple[float, float]:
        """Lowest and highest round of the figure that is judged: of the ratio where there is a reference."""
        return min(self._by_round), max(self._by_round)

    @property
    def _by_round(self) -> Sequence[float]:
        if not self.references:
            return self.values
        return [value / reference for value, reference in zip(self.values, self.references, strict=True)]

    @property
    def _worst_round(self) -> int:
        worst = max if self.better == "lower" else min
        return self._by_round.index(worst(self._by_round))

    @property
    def ok(self) -> bool:
        """Whether the promise is kept; True without one."""
        if self.bar is None:
            return True
        figure = self.value if self.ratio is None else self.ratio
        return figure <= self.bar if self.better == "lower" else figure >= self.bar

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Self:
        """Returns the row that `as_json` wrote; what follows from the rounds is computed again.

        Raises:
            KeyError: a field is missing.
            MeasurementError: as the constructor.
        """
        return cls(**{name: data[name] for name in cls.__slots__})

    def as_json(self) -> dict[str, Any]:
        """Returns the row for a JSON file, with what follows from the rounds for other readers."""
        written = {name: getattr(self, name) for name in self.__slots__}
        written["values"] = [_rounded(value) for value in self.values]
        written["references"] = [_rounded(value) for value in self.references]
        names = ("value", "median", "reference", "ratio")
        derived = {name: getattr(self, name) for name in names}
        return (
            written
            | {name: None if figure is None else _rounded(figure) for name, figure in derived.items()}
            | {"spread": [_rounded(figure) for figure in self.spread], "ok": self.ok}
        )


def _rounded(figure: float) -> float:
    return float(f"{figure:.{_SIGNIFICANT_DIGITS}g}")
