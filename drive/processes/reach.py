"""Whether the guard's zeros would reach what the worker's velocities reach. Without that nothing moves.

The publishers of the two are matched with the base's subscription one by one, each at a time of its own.
Between them the base follows the worker and does not know the guard: a worker that died then would leave it
moving.
"""

import socket
from contextlib import suppress
from typing import Final

from drive.motion.values import MS

_MAX_BYTES: Final = 16
_MOST: Final = 16
"""Words read at once; the guard says one when it changes."""
_GRACE_NS: Final = 5_000 * MS
"""For the guard to discover a further subscription while the robot is driven: milliseconds on a robot, and
seconds where an observer on another computer joins by radio, which must not stop the robot."""


class ReachSaid:
    """The guard's end.

    Args:
        worker: socket of packets that the heartbeats come from.
    """

    def __init__(self, worker: socket.socket) -> None:
        self._worker = worker
        self._said: int | None = None

    def say(self, matched: int) -> None:
        """Says how many subscriptions take the guard's zeros, where that has changed. Never waits.

        A worker that has no room for it hears it the next time.
        """
        if matched == self._said:
            return
        # One that has ended shows by the end of its heartbeats.
        with suppress(BlockingIOError, BrokenPipeError, ConnectionResetError):
            self._worker.send(str(matched).encode(), socket.MSG_DONTWAIT)
            self._said = matched


class ReachHeard:
    """The worker's end.

    Args:
        guard: socket of packets that the heartbeats go to.
    """

    def __init__(self, guard: socket.socket) -> None:
        self._guard = guard
        self._matched = 0
        self._both = 0
        """How many the worker has matched when the guard last had as many, and has still."""
        self._behind_ns: int | None = None
        """Since when the worker has more than that."""

    def reaches(self, matched: int, now_ns: int) -> bool:
        """Takes what the guard has said; returns whether it would stop the base. Never waits.

        Args:
            matched: how many subscriptions take the worker's velocities; 0 if the base is not among them.
            now_ns: the present instant.
        """
        self._hear()
        self._both = matched if self._matched >= matched else min(self._both, matched)
        # One that has died may count for the worker for some seconds longer than for the guard.
        if matched <= self._both:
            self._behind_ns = None
            return min(matched, self._matched) > 0
        self._behind_ns = now_ns if self._behind_ns is None else self._behind_ns
        return min(self._both, self._matched) > 0 and now_ns - self._behind_ns <= _GRACE_NS

    def _hear(self) -> None:
        # A guard that has ended shows by the next heartbeat.
        with suppress(BlockingIOError, ConnectionResetError):
            for _ in range(_MOST):
                word = self._guard.recv(_MAX_BYTES, socket.MSG_DONTWAIT)
                if not word:
                    return
                self._matched = int(word)
