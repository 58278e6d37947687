"""The receiver's metrics, in Prometheus' text form."""

from collections.abc import Callable
from typing import Final

from prometheus_client import CollectorRegistry, Counter, Gauge, generate_latest

_PREFIX: Final = "robot_receiver"


class ReceiverMetrics:
    """Counts what a receiver does.

    Args:
        bytes_read: Returns the bytes that were read again since the start.
        connected: Returns whether there is a connection to the hub.
    """

    def __init__(self, bytes_read: Callable[[], int], connected: Callable[[], bool]) -> None:
        self._registry = CollectorRegistry()
        self._requests = Counter(
            f"{_PREFIX}_requests",
            "Requests of robots and people, by name and outcome.",
            ("request", "outcome"),
            registry=self._registry,
        )
        self.in_hand = Gauge(f"{_PREFIX}_requests_in_hand", "Requests in hand.", registry=self._registry)
        self.swept = Counter(
            f"{_PREFIX}_uploads_swept", "Abandoned uploads that were deleted.", registry=self._registry
        )
        read = Gauge(f"{_PREFIX}_read_bytes", "Bytes read again since the start.", registry=self._registry)
        read.set_function(bytes_read)
        up = Gauge(f"{_PREFIX}_connected", "1: connected to the hub.", registry=self._registry)
        up.set_function(connected)

    def count(self, request: str, outcome: str) -> None:
        """Counts a request."""
        self._requests.labels(request, outcome).inc()

    def text(self) -> bytes:
        """Returns them all."""
        return generate_latest(self._registry)
