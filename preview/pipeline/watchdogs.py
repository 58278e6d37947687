"""Watchdogs for frames that stop without an error. Pure: evaluates counts and times.

A camera whose sensor stalls (v4l2src polls without a timeout) and an encoder whose driver sleeps post no
error.
"""

from preview.config import TimeoutSettings
from preview.pipeline.events import Blame


class Watchdogs:
    """One watchdog behind the source, one behind the encoder.

    Args:
        now: monotonic seconds at the start.
        timeouts: `start_s` until the source's first frame, `source_silence_s` between later ones, and
            `encoder_silence_s` without a frame of the encoder while it gets frames, also before its first.
    """

    def __init__(self, now: float, timeouts: TimeoutSettings) -> None:
        self._timeouts = timeouts
        self._captured = self._encoded = 0
        self._captured_at = self._encoded_at = now

    def check(
        self, captured: int, encoded: int, now: float, silence_s: float | None = None
    ) -> tuple[Blame, str] | None:
        """Evaluates the counts of this moment.

        Args:
            captured: frames from the source so far.
            encoded: encoded frames so far.
            now: monotonic seconds.
            silence_s: limit of this source between two frames; None: that of all.

        Returns:
            The part that exceeds its limit, and the predicate of its fault. The source first: without frames
            no encoder can deliver.
        """
        encoder_limit_s = self._timeouts.encoder_silence_s
        if captured != self._captured:
            if self._captured == 0 or now - self._captured_at > encoder_limit_s:
                # The encoder had no frames until now: its time starts here.
                self._encoded_at = now
            self._captured, self._captured_at = captured, now
        if encoded != self._encoded:
            self._encoded, self._encoded_at = encoded, now
        source_s, encoder_s = now - self._captured_at, now - self._encoded_at
        silence_limit_s = silence_s or self._timeouts.source_silence_s
        if source_s > (silence_limit_s if captured else self._timeouts.start_s):
            return Blame.SOURCE, f"has sent no frame for {source_s:.1f} s"
        if captured and source_s <= encoder_limit_s < encoder_s:
            return Blame.ENCODER, f"has produced no frame for {encoder_s:.1f} s"
        return None
