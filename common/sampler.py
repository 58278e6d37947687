"""The one thread of a program that reads ROS: it polls some twenty times a second. No executor spins.

An executor wakes up for every message, polling costs little more at a higher rate. An operator's screen
can't show more than twenty values a second, and a value's age is exact whenever it is fetched.
"""

import logging
import math
import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Final, Protocol, Self

_log = logging.getLogger(__name__)

SAMPLING_HZ: Final = 20.0
"""How often each source is polled: a value waits at most 50 ms."""

_STOP_WITHIN_S: Final = 5.0
_WARN_EVERY_S: Final = 10.0


class Watched(Protocol):
    """Where the end of each pass is noted."""

    ros_passed_s: float | None
    """Monotonic time of the newest one."""


class Takes(Protocol):
    """What the sampler needs of a source."""

    def take(self) -> None:
        """Fetches the newest value if there is a new one. Never waits."""


class Sampler:
    """Calls `take` of every source at fixed times, from `__enter__` to `__exit__`.

    What the graph holds can be anything, and rclpy raises many things: an error of one source costs that
    source one pass, never the thread. The end of each pass is noted, so that a thread that hangs in the
    middleware can be noticed.

    Args:
        sources: polled one after the other.
        watched: where the end of each pass is noted.
        rate_hz: how often.
    """

    def __init__(self, sources: Sequence[Takes], watched: Watched, rate_hz: float = SAMPLING_HZ) -> None:
        self._sources = tuple(sources)
        self._watched = watched
        self._period_s = 1 / rate_hz
        self._warned_at_s = -math.inf
        self._stop = threading.Event()
        # A daemon, so that a middleware call that never returns can't prevent the process from exiting.
        self._thread = threading.Thread(target=self._run, name="ros-sampler", daemon=True)

    def __enter__(self) -> Self:
        self._watched.ros_passed_s = time.monotonic()
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
                try:
                    source.take()
                except Exception:  # noqa: BLE001  # whatever it is: the other sources are read all the same
                    self._warn()
            self._watched.ros_passed_s = passed_s = time.monotonic()
            # Missed passes are skipped, not repeated: they would find nothing new.
            due_s = max(due_s + self._period_s, passed_s)

    def _warn(self) -> None:
        """Logs the present exception with its traceback, unless another one was logged lately."""
        now_s = time.monotonic()
        if now_s - self._warned_at_s >= _WARN_EVERY_S:
            self._warned_at_s = now_s
            _log.exception("a source can't be sampled; it is tried again at the next pass")
