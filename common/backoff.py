"""Exponential backoff: the growing pauses between attempts at something that keeps failing."""


def pause_s(failures: int, first_s: float, longest_s: float, factor: float = 2.0) -> float:
    """Returns the pause after so many failures in succession, in seconds; arguments as of `Backoff`."""
    try:
        return min(longest_s, first_s * float(factor) ** (failures - 1))
    except OverflowError:  # Failures go on for ever.
        return longest_s


class Backoff:
    """Pauses that grow by a constant factor with each failure, up to a limit.

    Pure: it neither sleeps nor reads a clock. There is no jitter, because a robot has a handful of
    clients, which do not fail in step.

    Args:
        first_s: Pause after the first failure, in seconds.
        longest_s: Upper limit of a pause, in seconds.
        factor: What each pause is multiplied by to get the next one; at least 1.
    """

    def __init__(self, first_s: float, longest_s: float, factor: float = 2.0) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._factor = factor
        self.failures = 0
        """Failures since the last success."""

    def next_s(self) -> float:
        """Counts a failure and returns the pause before the next attempt, in seconds."""
        self.failures += 1
        return pause_s(self.failures, self._first_s, self._longest_s, self._factor)

    def reset(self) -> None:
        """Starts again from the first pause, after a success."""
        self.failures = 0
