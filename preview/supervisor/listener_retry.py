"""When a listener that has failed is opened again, while its pipeline goes on without it.

| it fails | what follows |
|---|---|
| after a steady run | opened again at once |
| sooner | after 1, 2, 4 ... s |
| MOST_RETRIES times sooner, and then again, while no recording needs the pipeline | the pipeline fails |
| before the pipeline runs, while no recording needs it | the same |
"""

import asyncio
from collections.abc import Callable
from typing import Final

from common.backoff import Backoff
from common.timer import Timer
from preview.state.lifecycle import FIRST_RETRY_S, LONGEST_RETRY_S, STEADY_AFTER_S

MOST_RETRIES: Final = 3


class ListenerRetry:
    """Used on one event loop.

    Args:
        due: called when a listener may be opened again.

    Attributes:
        is_lost: whether the listener has failed, and has been neither closed nor opened again since.
    """

    def __init__(self, due: Callable[[], None]) -> None:
        self._due = due
        self._timer = Timer(due)
        self._backoff = Backoff(FIRST_RETRY_S, LONGEST_RETRY_S)
        self._serves_since_s = 0.0
        self.is_lost = False

    @property
    def waits(self) -> bool:
        """Whether a listener that has failed may not be opened yet."""
        return bool(self._timer)

    def serves(self) -> None:
        """Takes that the listener serves from now on."""
        self._serves_since_s = asyncio.get_running_loop().time()

    def replaced(self) -> None:
        """Takes that the listener was closed or opened anew, and if so serves from now on."""
        self.is_lost = False
        self.serves()

    def failed(self, *, running: bool, recorded: bool) -> bool:
        """Takes a failure of the listener.

        Args:
            running: whether its pipeline runs.
            recorded: whether a recording needs the pipeline.

        Returns:
            Whether the pipeline goes on, and the listener is opened again.
        """
        steady = running and asyncio.get_running_loop().time() - self._serves_since_s > STEADY_AFTER_S
        if steady:
            self._backoff.reset()
        if not recorded and (not running or self._backoff.failures >= MOST_RETRIES):
            return False
        self.is_lost = True
        self._timer.start(0.0 if steady else self._backoff.next_s())
        return True

    def now(self) -> None:
        """Has a listener that waits be opened now."""
        if self._timer.cancel():
            self._due()

    def reset(self) -> None:
        """The same, on request: further failures count from the first one."""
        self.now()
        self._backoff.reset()
