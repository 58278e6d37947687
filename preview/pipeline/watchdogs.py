"""Notices silence. Pure: told counts and times, says what is silent.

A camera whose sensor stalls and an encoder whose driver sleeps give no error: frames just stop.
"""

from dataclasses import dataclass
from enum import Enum


class Silent(Enum):
    """Who stopped delivering."""

    SOURCE = "source"
    ENCODER = "encoder"


@dataclass(slots=True)
class _Counter:
    count: int
    moved_at: float

    def see(self, count: int, now: float) -> None:
        if count != self.count:
            self.count = count
            self.moved_at = now


class Watchdogs:
    """One after the source, one after the encoder.

    Args:
        now: monotonic seconds at the start.
        first_frame_s: how long the source may take for its first frame.
        source_s: how long it may pause later.
        encoder_s: how long the encoder may take for its first picture once it has frames, and pause later.
    """

    def __init__(self, now: float, *, first_frame_s: float, source_s: float, encoder_s: float) -> None:
        self._first_frame_s = first_frame_s
        self._source_s = source_s
        self._encoder_s = encoder_s
        self._frames = _Counter(0, now)
        self._pictures = _Counter(0, now)

    def look(self, frames: int, pictures: int, now: float) -> Silent | None:
        """Takes the counts of this moment.

        Args:
            frames: frames that came from the source so far.
            pictures: encoded pictures so far.
            now: monotonic seconds.

        Returns:
            Who is silent beyond its limit, the source first: without frames no encoder can deliver.
        """
        idle_before = self._frames.count == 0 or now - self._frames.moved_at > self._encoder_s
        self._frames.see(frames, now)
        self._pictures.see(pictures, now)
        if self._frames.moved_at == now and idle_before:
            # The encoder had nothing to do until now.
            self._pictures.moved_at = now
        if now - self._frames.moved_at > (self._source_s if frames else self._first_frame_s):
            return Silent.SOURCE
        source_alive = frames > 0 and now - self._frames.moved_at <= self._encoder_s
        if source_alive and now - self._pictures.moved_at > self._encoder_s:
            return Silent.ENCODER
        return None

    def silence_s(self, silent: Silent, now: float) -> float:
        """For how long it has been silent."""
        counter = self._frames if silent is Silent.SOURCE else self._pictures
        return now - counter.moved_at
