"""How many events a second the hub takes, with three replicas, each message synced before it counts."""

import asyncio
import time
from pathlib import Path

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from fleet.connection import FleetAddress
from tests.support.secure_hub import secure_hub
from tests.support.simulated_fleet import simulated_fleet

ROBOTS = 1000
NODES = 3
MESSAGES = 5
BATCH = 8
"""Events in a message; a bridge puts up to 64 into one when they wait."""
BAR_EVENTS_S = 700


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    rates: dict[str, list[float]] = {"fleet.events_s": [], "fleet.batched_events_s": []}
    with secure_hub(workdir / "rates", NODES) as hub:
        address, first = hub.all_robots(), 0
        for _ in range(FEWEST_ROUNDS):
            for name, batch in (("fleet.events_s", 1), ("fleet.batched_events_s", BATCH)):
                rates[name].append(asyncio.run(_events_s(address, batch, range(first, first + MESSAGES))))
                # Sequences that no message of an earlier round has.
                first = (first + MESSAGES) * BATCH
    log(f"fleet: {rates}")
    beside = f"{ROBOTS} robots, over TLS, 3 replicas on one machine, each message synced"
    found = [
        Row(
            name="fleet.events_s",
            what=f"events that the hub takes, one in a message: {beside}",
            unit="events/s",
            values=rates["fleet.events_s"],
            bar=BAR_EVENTS_S,
            better="higher",
        ),
        Row(
            name="fleet.batched_events_s",
            what=f"events that the hub takes, {BATCH} in a message: {beside}",
            unit="events/s",
            values=rates["fleet.batched_events_s"],
            bar=None,
            better="higher",
        ),
    ]
    return [row for row in found if row.name in wanted]


async def _events_s(address: FleetAddress, batch: int, sequences: range) -> float:
    async with simulated_fleet(address, ROBOTS, batch) as fleet:
        begun_s = time.monotonic()
        await fleet.send(sequences)
        return ROBOTS * len(sequences) * batch / (time.monotonic() - begun_s)
