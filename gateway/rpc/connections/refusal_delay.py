"""Delays refusals, so that a client that repeats a refused call at once is slowed down by its own open calls.

To refuse costs nearly as much as to answer: without a delay, a dozen connections with a wrong token would
take the time of all others.
"""

import asyncio
from typing import Final, NoReturn

from common.errors import DomainError

REFUSAL_DELAY_S: Final = 0.5
"""Minimum delay of a refusal."""
REFUSAL_SPACING_S: Final = 0.005
"""Minimum spacing of delayed refusals, over all connections."""
_MAX_DELAYED: Final = 512
"""Refusals that are delayed at once, the last of them for 3.1 s, each of some 25 KiB: all that two
connections can have open. Any more leave at once, and their connection's calls wait from
then on (`Admission.note_excess`)."""
_LONGEST_DELAY_S: Final = REFUSAL_DELAY_S + _MAX_DELAYED * REFUSAL_SPACING_S
"""Also behind refusals whose callers have left, whose turns are not given back."""


class RefusalDelay:
    """The queue of refusals of all connections. Used on one event loop."""

    def __init__(self) -> None:
        self._delayed = 0
        self._last_s = 0.0
        """When the last one of them leaves, by the event loop's clock."""

    @property
    def full(self) -> bool:
        """Whether a further refusal leaves at once."""
        return self._delayed >= _MAX_DELAYED

    async def refuse(self, error: DomainError, waited_s: float = 0.0) -> NoReturn:
        """Raises the error when it is this refusal's turn.

        Args:
            error: the refusal.
            waited_s: how long its call has waited already (`Turns`).
        """
        if not self.full:
            self._delayed += 1
            try:
                await asyncio.sleep(self.next_delay_s(asyncio.get_running_loop().time(), waited_s))
            finally:
                self._delayed -= 1
        try:
            raise error
        finally:
            # Its traceback has this frame: a reference from here would keep both until the next collection.
            del error

    def next_delay_s(self, now_s: float, waited_s: float = 0.0) -> float:
        """Returns how long the next refusal waits: a minimum, and behind those that wait already."""
        minimum_s = max(0.0, REFUSAL_DELAY_S - waited_s)
        next_s = max(now_s + minimum_s, self._last_s + REFUSAL_SPACING_S)
        self._last_s = min(next_s, now_s + _LONGEST_DELAY_S)
        return self._last_s - now_s
