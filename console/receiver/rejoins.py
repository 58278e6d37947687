"""Paces the connections that are made anew in vain, and ends them. Pure."""

from typing import Final

from common.backoff import Backoff

_FIRST_PAUSE_S: Final = 0.25
_LONGEST_PAUSE_S: Final = 1.0
_LEAST_IN_VAIN: Final = 2
_GIVES_UP_AFTER_S: Final = 5.0


class Rejoins:
    """Decides when the next connection is made, and whether one is.

    The robot begins a connection with a key frame, for which all viewers wait and pay. Where one connection
    after another brings no picture, a further one helps less and less, and people should know.

    Args:
        now_s: when the first connection is begun.
    """

    def __init__(self, now_s: float) -> None:
        self._shown_s = now_s
        """When the newest picture came, at first when the first connection was begun."""
        self._in_vain = 0
        self._backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)

    def pause_s(self, now_s: float, shown_s: float | None) -> float | None:
        """Returns the pause before the next connection; None: there should be no further one.

        After a picture, and once without, there is no pause.

        Args:
            now_s: when the connection ended.
            shown_s: when its newest picture came; None if it has brought none.
        """
        if shown_s is not None:
            self._shown_s, self._in_vain = shown_s, 0
            self._backoff.reset()
            return 0.0
        self._in_vain += 1
        if self._in_vain >= _LEAST_IN_VAIN and self.without_s(now_s) >= _GIVES_UP_AFTER_S:
            return None
        return 0.0 if self._in_vain == 1 else self._backoff.next_s()

    def without_s(self, now_s: float) -> float:
        """Returns how long there has been no picture."""
        return now_s - self._shown_s
