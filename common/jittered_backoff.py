"""Pauses between attempts of a program that is one of many: exponential backoff with equal jitter."""

import asyncio
import random
from typing import Final

from common.backoff import Backoff

FIRST_S: Final = 1.0
LONGEST_S: Final = 60.0


class JitteredBackoff:
    """Pauses that grow from 1 s, each between half and all of the backoff's, so that no fleet is in step.

    Args:
        longest_s: upper limit of a pause, in seconds.
    """

    def __init__(self, longest_s: float = LONGEST_S) -> None:
        self._backoff = Backoff(FIRST_S, longest_s)

    @property
    def failures(self) -> int:
        """Failures since the last success."""
        return self._backoff.failures

    def next_s(self) -> float:
        """Counts a failure and returns the pause before the next attempt, in seconds."""
        return self._backoff.next_s() * random.uniform(0.5, 1.0)  # noqa: S311  # no secret

    async def wait(self) -> None:
        """Counts a failure and waits."""
        await asyncio.sleep(self.next_s())

    def reset(self) -> None:
        """Begins again with the shortest pause, after a success."""
        self._backoff.reset()
