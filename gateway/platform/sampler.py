"""Samples the robot's computer periodically, in a thread of its own.

A call of the file system can block (a network share that is gone). In a thread it blocks nothing else, and
the values become stale, as they should. The thread is a daemon, so that the gateway can exit while it blocks.
"""

import logging
import threading
import time
from types import TracebackType
from typing import Final, Self

from gateway.config import PlatformSettings
from gateway.platform import battery, compute, network
from gateway.status.board import Board
from gateway.status.sources import COMPUTE, NETWORK, ONBOARD_BATTERY
from gateway.status.values import Received

_log = logging.getLogger(__name__)

_STOP_WITHIN_S: Final = 1.0
_FIRST_AFTER_S: Final = 0.1
"""Seconds before the first sample: the CPU load is the difference of two readings."""


class PlatformSampler:
    """Writes the platform sources to the board while its context is entered.

    Args:
        settings: sampling interval, disk and network interface.
        board: receives the values.
    """

    def __init__(self, settings: PlatformSettings, board: Board) -> None:
        self._settings = settings
        self._board = board
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="platform-sampler", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join(_STOP_WITHIN_S)
        if self._thread.is_alive():
            _log.warning("the platform sampler is blocked in a system call; exiting without it")

    def sample(self) -> None:
        """Samples all values once."""
        self._board[COMPUTE] = Received(compute.read(self._settings.disk_path), time.monotonic())
        self._board[NETWORK] = Received(network.read(self._settings.interface), time.monotonic())
        onboard = battery.read()
        if onboard:
            self._board[ONBOARD_BATTERY] = Received(onboard, time.monotonic())

    def _run(self) -> None:
        interval_s = self._settings.interval_ms / 1000
        failing = False
        compute.begin()
        pause_s = min(_FIRST_AFTER_S, interval_s)
        while not self._stop.wait(pause_s):
            pause_s = interval_s
            try:
                self.sample()
                failing = False
            except (OSError, RuntimeError, ValueError, IndexError) as error:
                # The kernel's tables differ between machines; an unexpected one must not end the thread.
                if not failing:
                    _log.warning("the state of the computer can't be sampled: %s", error)
                failing = True
