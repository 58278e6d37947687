"""A stream's times in GStreamer, from its presentation time stamps. Pure."""

from typing import Final

from console.capture_time import Unwrapped, ticks_to_ns

_END_NS: Final = 1 << 63
"""GstClockTime has 64 bits without a sign, but GStreamer also reckons with it as with one that has a sign."""


class DecoderTime:
    """Follows the PTS of one stream over its wraps, as times that GStreamer can hold.

    A sender is free to stamp anything: one whose stamps run backwards for long enough, or jump ahead with
    every frame, leaves what GStreamer can hold. Its times begin anew then.
    """

    def __init__(self) -> None:
        self._pts = Unwrapped()

    def time_ns(self, pts_ticks: int) -> int:
        """Returns the time of a PTS, in ns; at least 0."""
        time_ns = ticks_to_ns(self._pts.ticks(pts_ticks))
        if not 0 <= time_ns < _END_NS:
            self._pts = Unwrapped()
            time_ns = ticks_to_ns(self._pts.ticks(pts_ticks))
        return time_ns
