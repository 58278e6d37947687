"""What became of the calls, by method and code, and how long they took."""

from collections import Counter
from typing import Final

import grpc

from gateway.metrics.histogram import Histogram

_BOUNDS_S: Final = (0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0)


class Calls:
    """What common.rpc's `observe` wants; belongs to the event loop.

    Only methods that exist come here, so there are few names, whatever anybody calls.
    """

    def __init__(self) -> None:
        self.ended: Counter[tuple[str, str]] = Counter()
        """By method ("GetSystemStatus") and code ("OK")."""
        self.durations: dict[str, Histogram] = {}

    def __call__(self, method: str, code: grpc.StatusCode, seconds: float) -> None:
        """One call has ended."""
        name = method.rpartition("/")[2]
        self.ended[name, code.name] += 1
        durations = self.durations.get(name)
        if durations is None:
            durations = self.durations[name] = Histogram(_BOUNDS_S)
        durations.add(seconds)
