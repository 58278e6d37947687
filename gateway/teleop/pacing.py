"""How many commands of a driver are passed on: the newest, at most 60 a second, and every release. Pure."""

from typing import Final, Generic, Protocol, TypeVar

from common.token_bucket import TokenBucket

PASSED_PER_S: Final = 60.0
"""The drive program publishes 50 velocities a second."""
_BURST: Final = 3
"""Commands that a jittery network delivers together."""


class _Command(Protocol):
    @property
    def held(self) -> bool:
        """Whether the driver holds."""


CommandT = TypeVar("CommandT", bound=_Command)


class Pacing(Generic[CommandT]):
    """Paces the commands of one session.

    Args:
        now_s: when it begins, monotonic seconds.
    """

    def __init__(self, now_s: float) -> None:
        self._bucket = TokenBucket(_BURST, now_s)
        self._held = False
        self._waiting: CommandT | None = None

    def take(self, command: CommandT, now_s: float) -> CommandT | None:
        """Returns the command if it is to be passed on now; None keeps it until `due`, or a newer one.

        A release passes at once: coalesced with a hold after it, it would be no release.
        """
        release = self._held and not command.held
        if self._pass(now_s) or release:
            return self._passed(command)
        self._waiting = command
        return None

    def due(self, now_s: float) -> CommandT | None:
        """Returns the command that waits, if its time has come."""
        if self._waiting is None or not self._pass(now_s):
            return None
        return self._passed(self._waiting)

    @property
    def due_in_s(self) -> float | None:
        """Seconds from the last `take` or `due` until one is due; None if none waits."""
        return max(0.0, (1 - self._bucket.tokens) / PASSED_PER_S) if self._waiting else None

    def _pass(self, now_s: float) -> bool:
        return self._bucket.take(now_s, capacity=_BURST, refill_per_s=PASSED_PER_S)

    def _passed(self, command: CommandT) -> CommandT:
        self._waiting, self._held = None, command.held
        return command
