"""The one thread that reads ROS: it polls every source some twenty times a second. No executor spins.

An executor wakes up for every message, polling costs the same at any message rate. An operator's screen can't
show more than twenty values a second, and a value's age is exact whenever it is fetched.
"""

import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Final, Protocol, Self

SAMPLING_HZ: Final = 20.0
"""How often each source is polled: a value waits at most 50 ms."""

_STOP_WITHIN_S = 5.0


class Takes(Protocol):
    """What the sampler needs of a source."""

    def take(self) -> None:
        """Fetches the newest value if there is a new one. Never raises, never waits."""


class Sampler:
    """Calls `take` of every source at fixed times, from `__enter__` to `__exit__`.

    Args:
        sources: polled one after the other.
        rate_hz: how often.
    """

    def __init__(self, sources: Sequence[Takes], rate_hz: float = SAMPLING_HZ) -> None:
        self._sources = tuple(sources)
        self._period_s = 1 / rate_hz
        self._stop = threading.Event()
        # A daemon, so that a middleware call that never returns can't prevent the process from exiting.
        self._thread = threading.Thread(target=self._run, name="ros-sampler", daemon=True)
        self.last_pass_at_s: float | None = None
        """When the newest pass ended, in monotonic seconds; None before the first."""

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join(_STOP_WITHIN_S)
        if self._thread.is_alive():
            raise TimeoutError(f"the ROS sampler did not stop within {_STOP_WITHIN_S:.0f} s")

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._stop.wait(max(0.0, due_s - time.monotonic())):
            for source in self._sources:
                source.take()
            self.last_pass_at_s = time.monotonic()
            # Missed passes are skipped, not repeated: they would find nothing new.
            due_s = max(due_s + self._period_s, self.last_pass_at_s)
