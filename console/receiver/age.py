"""Bounds the age of the frames of a connection. Pure."""

from typing import Final

_DRIFT: Final = 500e-6
"""Largest difference in rate of the two clocks with a margin: quartz clocks differ by at most 200 ppm."""
_JUMP_S: Final = 10.0
"""A change of age by more than this is a change of the sender's clock, not of the link."""


class AgeBound:
    """Decides when a connection is made anew, because what it delivers has become too old.

    Without TSBPD nothing is dropped as too late: on a link that is narrower than the stream, frames get older
    without bound. A new connection starts at the newest key frame. It helps only against age that has grown
    on this connection, so age that was there from the beginning does not count.

    Args:
        bound_s: largest permitted age.
    """

    def __init__(self, bound_s: float) -> None:
        self._bound_s = bound_s
        self._least_s: float | None = None
        self._noted_s = 0.0

    def exceeded(self, now_s: float, time_s: float, age_s: float | None) -> bool:
        """Whether the newest frame is too old.

        Args:
            now_s: this computer's monotonic clock.
            time_s: the frame's time on a clock of the sender that does not wrap.
            age_s: the frame's age, if it is known; else it counts from the shortest delay seen.
        """
        delay_s = now_s - time_s
        least_s = self._least_s
        if least_s is None or abs(delay_s - least_s) > _JUMP_S:
            least_s = delay_s
        # The floor rises a little, so that a drift of the clocks does not look like age.
        least_s = min(delay_s, least_s + _DRIFT * (now_s - self._noted_s))
        self._least_s, self._noted_s = least_s, now_s
        grown_s = delay_s - least_s
        if age_s is None:
            return grown_s > self._bound_s
        return age_s > self._bound_s and grown_s > self._bound_s / 2
