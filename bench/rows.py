"""The one language of the benchmarks: a row is a figure, its reference and the promised limit."""

from dataclasses import asdict, dataclass, fields
from typing import Any, Literal


@dataclass(frozen=True, slots=True)
class Row:
    """One measured figure.

    Args:
        name: fixed, "ros.intake" for example; the first part is the group.
        what: one line for a person: what was measured against what.
        unit: of value and reference.
        value: what our product needs.
        reference: what the reference needed in the same run. None where the bar is on the value itself.
        bar: the promised limit, on the ratio where there is a reference, else on the value.
        better: "lower": at most the bar keeps the promise; "higher": at least the bar does.
    """

    name: str
    what: str
    unit: str
    value: float
    reference: float | None
    bar: float
    better: Literal["lower", "higher"] = "lower"

    @property
    def ratio(self) -> float | None:
        """Value by reference."""
        return self.value / self.reference if self.reference else None

    @property
    def ok(self) -> bool:
        """Whether the promise is kept."""
        figure = self.value if self.ratio is None else self.ratio
        return figure <= self.bar if self.better == "lower" else figure >= self.bar

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "Row":
        """The row that the JSON file of another run holds."""
        return cls(**{field.name: data[field.name] for field in fields(cls)})

    def as_json(self) -> dict[str, Any]:
        """The row as the JSON file holds it."""
        return asdict(self) | {"ratio": self.ratio, "ok": self.ok}
