"""Suspends of the computer that a test plays, in the place of `common.suspend.SuspendedTime`."""


class PlayedSuspends:
    """Makes measurements of all suspends so far; a test lengthens them.

    Attributes:
        total_s: of all suspends.
    """

    def __init__(self) -> None:
        self.total_s = 0.0

    def __call__(self) -> "_Measured":
        return _Measured(self, self.total_s)


class _Measured:
    """The time since one instant."""

    def __init__(self, played: PlayedSuspends, begin_s: float) -> None:
        self._played, self._begin_s = played, begin_s

    def seconds(self) -> float:
        return self._played.total_s - self._begin_s
