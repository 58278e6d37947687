"""A monotonic clock for tests of pure code."""


class Clock:
    """Moves by hand.

    Args:
        now_s: the present, in seconds; assigned to move the clock.
    """

    def __init__(self, now_s: float = 100.0) -> None:
        self.now_s = now_s

    def __call__(self) -> float:
        return self.now_s
