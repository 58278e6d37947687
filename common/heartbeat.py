"""What a program says to its supervisor, by the protocol of sd_notify(3): that it serves, lives, and ends.

A supervisor that listens (common.guard, or systemd with Type=notify) sets NOTIFY_SOCKET, and WATCHDOG_USEC if
it wants heartbeats (WatchdogSec=). A loop that is blocked sends none, nor does a process that is stopped.
"""

import asyncio
import logging
import os
import socket
import time
from functools import cache
from typing import Final

_log = logging.getLogger(__name__)

_PER_INTERVAL: Final = 2
"""sd_watchdog_enabled(3) recommends half of what the supervisor allows."""


class Heartbeats:
    """Sends notifications to the supervisor of this process, if there is one that listens.

    The variables are removed from the environment: child processes must not answer for this one.

    Attributes:
        interval_s: between two heartbeats, half of what the supervisor allows; 0 if none are wanted.
        withheld: what hangs in this process while its loop runs, for the log; while it is not empty no
            heartbeats are sent, so that the supervisor starts the program again.
    """

    def __init__(self) -> None:
        address = os.environ.pop("NOTIFY_SOCKET", "")
        interval_s = _watchdog_s() / _PER_INTERVAL
        self.interval_s = interval_s if address else 0.0
        self.withheld = ""
        # The abstract namespace of unix(7).
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._due_s = 0.0

    def send(self) -> None:
        """Sends a heartbeat if one is due. Never waits."""
        if not self.interval_s or time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + self.interval_s / 2
        if self.withheld:
            _log.error("no heartbeat, so that this program is started again: %s", self.withheld)
        else:
            self._notify(b"WATCHDOG=1")

    def ready(self) -> None:
        """Says that the program serves now. Never waits."""
        self._notify(b"READY=1")

    def stopping(self) -> None:
        """Says that the program has begun to end. Never waits."""
        self._notify(b"STOPPING=1")

    def _notify(self, message: bytes) -> None:
        if not self._address:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as supervisor:
                supervisor.setblocking(False)
                supervisor.sendto(message, self._address)
        except OSError as error:
            _log.warning("%s did not reach the supervisor: %s", message.decode(), error)


@cache
def own() -> Heartbeats:
    """Returns those of this process; the first call reads the environment."""
    return Heartbeats()


async def send() -> None:
    """Sends heartbeats until cancelled, two in each period; returns at once if no supervisor wants any."""
    heartbeats = own()
    while heartbeats.interval_s:
        heartbeats.send()
        await asyncio.sleep(heartbeats.interval_s)


def _watchdog_s() -> float:
    """Returns how long the supervisor waits for a heartbeat; 0 if it wants none of this process."""
    microseconds, pid = os.environ.pop("WATCHDOG_USEC", ""), os.environ.pop("WATCHDOG_PID", "")
    # A supervisor that names another process takes none of this one (sd_watchdog_enabled(3)).
    if pid and pid != str(os.getpid()):
        return 0.0
    return int(microseconds) / 1e6 if microseconds.isascii() and microseconds.isdigit() else 0.0
