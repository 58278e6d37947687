"""Heartbeats of a program, by the watchdog protocol of sd_notify(3).

A supervisor that wants them (common.guard, or systemd with WatchdogSec=) sets NOTIFY_SOCKET and
WATCHDOG_USEC. A loop that is blocked sends none, nor does a process that is stopped.
"""

import asyncio
import logging
import os
import socket
import time

_log = logging.getLogger(__name__)


class Heartbeats:
    """Sends heartbeats to the supervisor of this process, if there is one that wants them.

    Both variables are removed from the environment: child processes must not answer for this one.

    Attributes:
        interval_s: between two of them, half of what the supervisor allows; 0 if none are wanted.
    """

    def __init__(self) -> None:
        address = os.environ.pop("NOTIFY_SOCKET", "")
        interval_s = int(os.environ.pop("WATCHDOG_USEC", "0")) / 1e6 / 2
        self.interval_s = interval_s if address else 0.0
        # The abstract namespace of unix(7).
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._due_s = 0.0

    def send(self) -> None:
        """Sends one if it is due. Never waits."""
        if not self.interval_s or time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + self.interval_s / 2
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as supervisor:
            supervisor.setblocking(False)
            try:
                supervisor.sendto(b"WATCHDOG=1", self._address)
            except OSError as error:
                _log.warning("a heartbeat did not reach the supervisor: %s", error)


async def send() -> None:
    """Sends heartbeats until cancelled, two in each period; returns at once if no supervisor wants any."""
    heartbeats = Heartbeats()
    while heartbeats.interval_s:
        heartbeats.send()
        await asyncio.sleep(heartbeats.interval_s)
