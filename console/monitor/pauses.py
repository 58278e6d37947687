"""How long to wait before a robot that did not answer, or refused, is asked again. Pure."""

from typing import Final

from console.client import Backoff, GatewayError, NotAllowed, NotTrusted

_LONGEST_WAIT_S: Final = 60.0
"""No gateway locks anybody out for longer; who asks for more patience than that is not one."""


class Pauses:
    """The pauses between attempts: each family of trouble has its own, which begin anew after an answer.

    Args:
        lost: while the robot does not answer.
        refused: while it does not take the login. Showing the same one often would look like guessing, and
            lock out who is meant by it.
    """

    def __init__(self, lost: Backoff, refused: Backoff) -> None:
        self._lost, self._refused = lost, refused
        self.reset()

    def after(self, trouble: GatewayError) -> float:
        """The pause after this, in seconds; no shorter than the robot wants it."""
        of_login = isinstance(trouble, NotAllowed | NotTrusted)
        pause_s = next(self._refused_pauses if of_login else self._lost_pauses)
        return max(pause_s, min(trouble.retry_after_s or 0.0, _LONGEST_WAIT_S))

    def reset(self) -> None:
        """The robot has answered."""
        self._lost_pauses, self._refused_pauses = self._lost.pauses(), self._refused.pauses()
