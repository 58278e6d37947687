"""A threshold with hysteresis."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limit:
    """A threshold with hysteresis.

    An upper limit if `raise_at` is the larger value (temperature), a lower limit if it is the smaller one
    (state of charge).
    """

    raise_at: float
    clear_at: float

    def broken(self, value: float, *, was_broken: bool) -> bool:
        """Returns whether `value` violates the limit, given the previous verdict."""
        threshold = self.clear_at if was_broken else self.raise_at
        if self.raise_at > self.clear_at:
            return value > threshold if was_broken else value >= threshold
        return value < threshold if was_broken else value <= threshold
