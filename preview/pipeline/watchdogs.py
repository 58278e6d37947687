"""Watchdogs for frames that stop without an error. Pure: evaluates counts and times.

A camera whose sensor stalls (v4l2src polls without a timeout) and an encoder whose driver sleeps post no
error.
"""

from dataclasses import dataclass
from enum import Enum

from preview.config import TimeoutSettings


class Silent(Enum):
    """Part that stopped delivering."""

    SOURCE = "source"
    ENCODER = "encoder"


@dataclass(slots=True)
class _Counter:
    count: int
    changed_at: float

    def update(self, count: int, now: float) -> None:
        if count != self.count:
            self.count = count
            self.changed_at = now


class Watchdogs:
    """One watchdog behind the source, one behind the encoder.

    Args:
        now: monotonic seconds at the start.
        timeouts: `start_s` until the source's first frame, `source_silence_s` between later ones, and
            `encoder_silence_s` without a frame of the encoder while it gets frames, also before its first.
    """

    def __init__(self, now: float, timeouts: TimeoutSettings) -> None:
        self._first_frame_s = timeouts.start_s
        self._source_s = timeouts.source_silence_s
        self._encoder_s = timeouts.encoder_silence_s
        self._captured = _Counter(0, now)
        self._encoded = _Counter(0, now)

    def check(self, captured: int, encoded: int, now: float) -> Silent | None:
        """Evaluates the counts of this moment.

        Args:
            captured: frames from the source so far.
            encoded: encoded frames so far.
            now: monotonic seconds.

        Returns:
            The part that exceeds its limit, the source first: without frames no encoder can deliver.
        """
        was_idle = self._captured.count == 0 or now - self._captured.changed_at > self._encoder_s
        self._captured.update(captured, now)
        self._encoded.update(encoded, now)
        if self._captured.changed_at == now and was_idle:
            # The encoder had no frames until now: its time starts here.
            self._encoded.changed_at = now
        silence_s = now - self._captured.changed_at
        if silence_s > (self._source_s if captured else self._first_frame_s):
            return Silent.SOURCE
        source_delivers = captured > 0 and silence_s <= self._encoder_s
        if source_delivers and now - self._encoded.changed_at > self._encoder_s:
            return Silent.ENCODER
        return None

    def silence_s(self, silent: Silent, now: float) -> float:
        """Returns for how many seconds a part has delivered nothing."""
        counter = self._captured if silent is Silent.SOURCE else self._encoded
        return now - counter.changed_at
