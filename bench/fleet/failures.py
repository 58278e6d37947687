"""What a fleet of 1000 robots loses while nodes of the hub are killed: leader, follower, all in turn."""

import asyncio
from dataclasses import dataclass
from pathlib import Path

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from fleet import names
from fleet.connection import FleetAddress
from tests.support.nats_servers import NatsServers
from tests.support.secure_hub import secure_hub
from tests.support.simulated_fleet import Fleet, Received, received, simulated_fleet

ROBOTS = 1000
NODES = 3
KILLS = 5
"""The leader, a follower, and each of the three."""
MESSAGES_PER_KILL = 4
MESSAGES = KILLS * MESSAGES_PER_KILL
BAR_GAP_S = 15.0


@dataclass(frozen=True)
class Round:
    """One round: what arrived, and the longest that a message took."""

    arrived: Received
    gap_s: float


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    rounds = [one_round(workdir / f"failures{number}", ROBOTS) for number in range(FEWEST_ROUNDS)]
    during = f"{ROBOTS} robots x {MESSAGES} events over TLS, {KILLS} kills of nodes (kill -9)"
    found = [
        Row(
            name=f"fleet.{name}",
            what=f"{what}: {during}",
            unit="",
            values=[float(getattr(each.arrived, name)) for each in rounds],
            bar=0,
            judged="worst",
        )
        for name, what in (
            ("lost", "events that the hub does not have"),
            ("duplicates", "events that it has twice"),
            ("disordered", "robots whose events are out of order"),
        )
    ]
    found.append(
        Row(
            name="fleet.gap_s",
            what=f"longest time from the first attempt at an event until the hub had it: {during}",
            unit="s",
            values=[each.gap_s for each in rounds],
            bar=BAR_GAP_S,
            judged="worst",
        )
    )
    return [row for row in found if row.name in wanted]


def one_round(directory: Path, robots: int) -> Round:
    with secure_hub(directory, NODES) as hub:
        gap_s = asyncio.run(_send_and_kill(hub.servers, hub.all_robots(), robots))
        arrived = asyncio.run(received(hub.administrator(), robots, MESSAGES))
    log(f"fleet: {arrived}, longest {gap_s:.1f} s")
    return Round(arrived, gap_s)


async def _send_and_kill(servers: NatsServers, address: FleetAddress, robots: int) -> float:
    async with simulated_fleet(address, robots) as fleet:
        for kill in range(KILLS):
            first = kill * MESSAGES_PER_KILL
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(fleet.send(range(first, first + MESSAGES_PER_KILL)))
                await fleet.sent_at_least(fleet.sent + robots * MESSAGES_PER_KILL // 3)
                await asyncio.to_thread(_kill_and_restart, servers, fleet, kill)
        return fleet.longest_s


def _kill_and_restart(servers: NatsServers, fleet: Fleet, kill: int) -> None:
    leader = servers.leader(names.EVENTS)
    node = (leader, ((leader or 0) + 1) % NODES)[kill] if kill < 2 else kill - 2
    if node is None:
        raise RuntimeError("the stream of events has no leader")
    log(f"fleet: kill -9 of {'the leader' if node == leader else 'a follower'}, n{node}, at {fleet.sent}")
    servers.kill(node)
    servers.start(node)
    servers.wait_healthy()
