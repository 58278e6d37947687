"""What the writer's thread reports: handed over to the event loop, in order."""

import asyncio
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from recorder.writing.output import Closed, Output


@dataclass(frozen=True, slots=True)
class Finished:
    """A segment has become final."""

    output: Output
    closed: Closed


@dataclass(frozen=True, slots=True)
class Failed:
    """The disk has failed an output, which the writer has removed."""

    output: Output
    error: OSError


class Reports:
    """Bounded by what the writer can do: two outputs, one report for each segment.

    Attributes:
        wake: set with each report, and by what else is to be looked at soon.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: deque[Finished | Failed] = deque()
        self.wake = asyncio.Event()

    def closed(self, output: Output, closed: Closed) -> None:
        """Takes a final segment; for the writer's thread."""
        self._loop.call_soon_threadsafe(self._note, Finished(output, closed))

    def failed(self, output: Output, error: OSError) -> None:
        """Takes a failure; for the writer's thread."""
        self._loop.call_soon_threadsafe(self._note, Failed(output, error))

    def take(self) -> Iterator[Finished | Failed]:
        """Yields what waits, and what comes meanwhile."""
        while self._waiting:
            yield self._waiting.popleft()

    def _note(self, report: Finished | Failed) -> None:
        self._waiting.append(report)
        self.wake.set()
