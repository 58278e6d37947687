"""Counts of the program, by topic; written by the cameras' threads, read by any."""

import threading
from dataclasses import dataclass, field
from typing import Any, Final

from tap.refusal import Reason

MAX_TOPICS: Final = 64
"""Counted separately; a preview names 16 at the most, and its configuration may change."""
OTHERS: Final = "others"


@dataclass(slots=True)
class _Counts:
    frames: int = 0
    bytes: int = 0
    stamps_replaced: int = 0
    connections: int = 0
    refused: dict[Reason, int] = field(default_factory=lambda: dict.fromkeys(Reason, 0))


class Totals:
    """The counts since the process started."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._topics: dict[str, _Counts] = {}

    def connected(self, topic: str) -> None:
        """Counts a connection for a topic."""
        with self._lock:
            self._of(topic).connections += 1

    def sent(self, topic: str, size: int, stamps_replaced: int) -> None:
        """Counts a frame.

        Args:
            topic: of the frame.
            size: in bytes.
            stamps_replaced: 1 if its own stamp was not used, else 0.
        """
        with self._lock:
            counts = self._of(topic)
            counts.frames += 1
            counts.bytes += size
            counts.stamps_replaced += stamps_replaced

    def refused(self, topic: str, reason: Reason) -> None:
        """Counts a message that is not shown."""
        with self._lock:
            self._of(topic).refused[reason] += 1

    def as_dict(self) -> dict[str, Any]:
        """Returns the counts by topic, for the state."""
        with self._lock:
            return {
                topic: {
                    "connections": counts.connections,
                    "frames": counts.frames,
                    "bytes": counts.bytes,
                    "stamps_replaced": counts.stamps_replaced,
                    "refused": {reason.value: count for reason, count in counts.refused.items()},
                }
                for topic, counts in self._topics.items()
            }

    def _of(self, topic: str) -> _Counts:
        if topic not in self._topics and len(self._topics) >= MAX_TOPICS:
            topic = OTHERS
        return self._topics.setdefault(topic, _Counts())
