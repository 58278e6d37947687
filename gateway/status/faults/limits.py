"""Limits with hysteresis: a fault is raised at one value and over at another, so that noise makes no news."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limit:
    """From which value on something is wrong, and from which it is well again.

    Where `raise_at` is the larger one, large values are wrong (heat); where it is the smaller one, small
    values are (a battery's charge).
    """

    raise_at: float
    clear_at: float

    def broken(self, value: float, *, was_broken: bool) -> bool:
        """Whether `value` is wrong, given what was said before."""
        threshold = self.clear_at if was_broken else self.raise_at
        if self.raise_at > self.clear_at:
            return value > threshold if was_broken else value >= threshold
        return value < threshold if was_broken else value <= threshold


@dataclass(frozen=True, slots=True)
class PlatformLimits:
    """What the robot's computer and batteries should stay within."""

    temperature_c: Limit
    memory_percent: Limit
    disk_percent: Limit
    battery_percent: Limit
    wifi_signal_dbm: Limit
