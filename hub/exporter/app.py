"""The exporter's program: follows the hub's buckets, and serves the metrics."""

import asyncio
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from common.metrics_endpoint import serving_metrics
from common.tasks import first_to_end
from fleet.clock import HubClock, read_clock
from fleet.connection import FleetAddress, Hub, connect
from fleet.errors import HubError
from fleet.names import ROBOTS, STATES
from hub.exporter.collector import FleetCollector
from hub.jetstream.streams import REPORTED, use_of

_MS_PER_S: Final = 1000
_CLOCK_AGAIN_AFTER_S: Final = 60.0
_STREAMS_EVERY_S: Final = 30.0
_FIRST_CLOCK_WITHIN_S: Final = 2.0
"""Without an answer it is tried again so soon: until then, this computer's clock counts."""


class FleetExporter:
    """Follows the hub into a collector. Made for one connection.

    Args:
        hub: The hub; it need not answer yet.
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._clock = HubClock(time.time() - time.monotonic())
        self.collector = FleetCollector(self._now_unix_ms, lambda: hub.link.connected)

    async def run(self) -> None:
        """Follows until it is cancelled, over all lost connections."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._robots())
            tasks.create_task(self._states())
            tasks.create_task(self._keep_time())
            tasks.create_task(self._look_at_streams())

    def _now_unix_ms(self) -> int:
        # The clock is read again and again.
        return self._clock.unix_ms()

    async def _robots(self) -> None:
        async for entry in self._hub.watch_bucket(ROBOTS):
            self.collector.take_robot(entry.key, entry.value, deleted=entry.deleted)

    async def _states(self) -> None:
        async for entry in self._hub.watch_bucket(STATES):
            received = round(entry.unix_s * _MS_PER_S)
            self.collector.take_state(entry.key, entry.value, received, deleted=entry.deleted)

    async def _look_at_streams(self) -> None:
        while True:
            await self._hub.connected()
            with suppress(HubError):
                for stream in REPORTED:
                    self.collector.take_use(await use_of(self._hub, stream))
            await asyncio.sleep(_STREAMS_EVERY_S)

    async def _keep_time(self) -> None:
        while True:
            pause_s = _FIRST_CLOCK_WITHIN_S
            # While the hub does not answer, the last reading counts on; `hub_connected` says so.
            with suppress(HubError):
                self._clock = await read_clock(self._hub)
                pause_s = _CLOCK_AGAIN_AFTER_S
            await asyncio.sleep(pause_s)


async def export(
    address: FleetAddress,
    host: str,
    port: int,
    stop: asyncio.Event,
    listening: Callable[[int], None] = lambda _: None,
) -> None:
    """Serves the fleet's metrics until `stop`.

    Args:
        address: Of the hub.
        host: An address of this machine.
        port: 0 for any free one.
        stop: Ends it.
        listening: Called with the bound port.

    Raises:
        UserError: The address can't be bound.
    """
    async with connect(address) as hub:
        exporter = FleetExporter(hub)
        async with serving_metrics(exporter.collector.text, host, port) as bound:
            listening(bound)
            # A defect ends the program: a page with the last state for ever would raise no alarm.
            await first_to_end(stop.wait(), hub.lasting(), exporter.run())


async def export_until_stopped(address: FleetAddress, host: str, port: int) -> None:
    """Serves until SIGINT or SIGTERM.

    Raises:
        UserError: The address can't be bound.
    """
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    await export(address, host, port, stop)
