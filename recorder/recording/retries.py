"""When the disk is tried again after an error: each thing that it fails has pauses of its own."""

from collections.abc import Callable
from typing import Final

from common.backoff import Backoff

FIRST_S: Final = 1.0
LONGEST_S: Final = 30.0


class Retries:
    """The attempts at one thing: after 1, 2, 4 ... 30 s, and from 1 s again after a success.

    Args:
        clock: monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._backoff = Backoff(FIRST_S, LONGEST_S)
        self._due_s = float("-inf")

    @property
    def due(self) -> bool:
        """Whether it may be tried."""
        return self._clock() >= self._due_s

    @property
    def failures(self) -> int:
        """Attempts that failed since the last success."""
        return self._backoff.failures

    def failed(self) -> None:
        """Takes note of a failure: it is not due before the next pause has ended."""
        self._due_s = self._clock() + self._backoff.next_s()

    def succeeded(self) -> None:
        """Takes note that the disk has taken it to its end."""
        self._backoff.reset()
