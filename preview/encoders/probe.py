"""Runs the trials of encoders, one at a time, and keeps their results. Pure: the trial itself is injected.

A result is kept for the life of this process, unless its cause may have been a busy machine: a deadline that
was missed, a process that could not be started. Such a trial is repeated in the background, with a growing
pause, and the next start of the preview uses what has been proven by then.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from typing import Final

from common.backoff import Backoff
from common.tasks import cancel
from common.trial import TrialError
from preview.encoders.catalogue import Encoder

_log = logging.getLogger(__name__)

FIRST_RETRY_S: Final = 10.0
LONGEST_RETRY_S: Final = 600.0


@dataclass(frozen=True, slots=True)
class Verdict:
    """Result of the trial of an encoder.

    Args:
        present: whether the element exists on this machine.
        proven: whether it encoded frames.
        reason: why it is not present or not proven, for people; empty when proven.
        first_byte_ms: time from the first frame in to the first byte out; None when not proven.
    """

    present: bool
    proven: bool
    reason: str = ""
    first_byte_ms: float | None = None


class TrialProber:
    """Trials and their results.

    Args:
        attempt: runs one trial; raises TrialError where an element exists and does not encode.
        repeats: whether trials are repeated that a busy machine may have spoiled.

    Attributes:
        verdicts: newest results, by encoder name; what is known before the first trial replaces it.
    """

    def __init__(self, attempt: Callable[[Encoder], Awaitable[Verdict]], *, repeats: bool = True) -> None:
        self.verdicts: dict[str, Verdict] = {}
        self._attempt = attempt
        self._repeats = repeats
        self._one_at_a_time = asyncio.Lock()
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._first: dict[str, asyncio.Future[None]] = {}
        """Done when the first trial is."""

    async def verdict(self, encoder: Encoder) -> Verdict:
        """Returns the newest result for one encoder; runs its trial when there is none."""
        name = encoder.name
        if name not in self._tasks and name in self.verdicts:
            return self.verdicts[name]
        if name not in self._tasks:
            self._first[name] = asyncio.get_running_loop().create_future()
            self._tasks[name] = asyncio.create_task(self._try(encoder), name=f"trials of {name}")
        # A cancelled caller does not cancel the trial: others may wait for it, too.
        await asyncio.shield(self._first[name])
        return self.verdicts[name]

    async def try_all(self, encoders: Iterable[Encoder]) -> None:
        """Runs the trials of these encoders, in order."""
        for encoder in encoders:
            await self.verdict(encoder)

    async def close(self) -> None:
        """Cancels the trials, which kills their processes."""
        await cancel([*self._tasks.values(), *self._first.values()])

    async def _try(self, encoder: Encoder) -> None:
        """Tries an encoder until the result is final."""
        backoff = Backoff(FIRST_RETRY_S, LONGEST_RETRY_S)
        pause_s: float | None = 0.0
        while pause_s is not None:
            await asyncio.sleep(pause_s)
            pause_s = None
            async with self._one_at_a_time:
                try:
                    verdict = await self._attempt(encoder)
                except TrialError as error:
                    reason = str(error)
                    if error.passing and self._repeats:
                        pause_s = backoff.next_s()
                        reason += f" (tried again after {pause_s:g} s, for the next start of the preview)"
                    verdict = Verdict(present=True, proven=False, reason=reason)
                except Exception as error:  # noqa: BLE001  # unknown; the preview waits, and has other encoders
                    _log.exception("the trial of %s failed", encoder.name)
                    reason = f"its trial failed: {type(error).__name__}: {error}"
                    verdict = Verdict(present=True, proven=False, reason=reason)
            if verdict.proven and backoff.failures:
                _log.info("encoder %s works now: the next start of the preview uses it", encoder.name)
            self.verdicts[encoder.name] = verdict
            if not self._first[encoder.name].done():
                self._first[encoder.name].set_result(None)
