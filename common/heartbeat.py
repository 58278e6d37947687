"""Heartbeats of a program's event loop, by the watchdog protocol of sd_notify(3).

A supervisor that wants them (common.guard, or systemd with WatchdogSec=) sets NOTIFY_SOCKET and
WATCHDOG_USEC. A loop that is blocked sends none, nor does a process that is stopped.
"""

import asyncio
import logging
import os
import socket

_log = logging.getLogger(__name__)


async def send() -> None:
    """Sends heartbeats until cancelled, two in each period; returns at once if no supervisor wants any.

    Both variables are removed from the environment: child processes must not answer for this one.
    """
    address = os.environ.pop("NOTIFY_SOCKET", "")
    interval_s = int(os.environ.pop("WATCHDOG_USEC", "0")) / 1e6 / 2
    if not address or not interval_s:
        return
    if address.startswith("@"):
        address = "\0" + address[1:]  # The abstract namespace of unix(7).
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as supervisor:
        supervisor.setblocking(False)
        while True:
            try:
                supervisor.sendto(b"WATCHDOG=1", address)
            except OSError as error:
                _log.warning("a heartbeat did not reach the supervisor: %s", error)
            await asyncio.sleep(interval_s)
