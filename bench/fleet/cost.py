"""What one more robot costs a server: memory of its connection, and CPU time of its states.

With 1000 robots against 100: flat means that a robot of a large fleet costs what one of a small fleet does.
"""

import asyncio
from collections import Counter
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path

from bench.fleet.cluster import cluster
from bench.processes import cpu_seconds, resident_mib
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from fleet import names
from fleet.connection import FleetAddress, Hub, connect

FEW, MANY = 100, 1000
WINDOW_S = 5.0
PERIOD_S = 1.0
BAR = 1.5


@dataclass(frozen=True)
class Cost:
    """Of one robot."""

    kib: float
    state_us: float
    """CPU time for each of its states: how many there are depends on how busy this machine is."""


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    few, many = [], []
    for number in range(FEWEST_ROUNDS):
        few.append(one_round(workdir / f"few{number}", FEW))
        many.append(one_round(workdir / f"many{number}", MANY))
        log(f"fleet: {few[-1]}, {many[-1]}")
    against = f"with {MANY} robots, against {FEW}, each with a connection of its own and a state a second"
    found = [
        Row(
            name="fleet.robot_kib",
            what=f"memory of the server for each robot: {against}",
            unit="KiB",
            values=[each.kib for each in many],
            references=[each.kib for each in few],
            bar=BAR,
        ),
        Row(
            name="fleet.state_cpu_us",
            what=f"CPU time of the server for each state: {against}",
            unit="us",
            values=[each.state_us for each in many],
            references=[each.state_us for each in few],
            bar=BAR,
        ),
    ]
    return [row for row in found if row.name in wanted]


def one_round(directory: Path, robots: int) -> Cost:
    with cluster(directory, nodes=1) as servers:
        process = servers.processes[0]
        if process is None:
            raise RuntimeError("the server does not run")
        return asyncio.run(_cost(servers.urls, process.pid, robots))


async def _cost(servers: tuple[str, ...], pid: int, robots: int) -> Cost:
    empty_mib = resident_mib(pid)
    async with AsyncExitStack() as stack:
        hubs = [await stack.enter_async_context(connect(FleetAddress(servers))) for _ in range(robots)]
        for hub in hubs:
            await hub.connected(60)
        async with asyncio.TaskGroup() as tasks:
            states: Counter[str] = Counter()
            reporting = [
                tasks.create_task(_report(hub, f"r{number}", states)) for number, hub in enumerate(hubs)
            ]
            await asyncio.sleep(PERIOD_S)  # every robot has reported once
            before_s, first = cpu_seconds(pid), states.total()
            await asyncio.sleep(WINDOW_S)
            cpu_s, count = cpu_seconds(pid) - before_s, states.total() - first
            full_mib = resident_mib(pid)
            for each in reporting:
                each.cancel()
    return Cost((full_mib - empty_mib) * 1024 / robots, 1e6 * cpu_s / count)


async def _report(hub: Hub, robot: str, states: Counter[str]) -> None:
    """A state a second, at an instant of the robot's own."""
    await asyncio.sleep(hash(robot) % 1000 / 1000 * PERIOD_S)
    while True:
        await hub.put(names.STATES, robot, b"x" * 400, 10)
        states[robot] += 1
        await asyncio.sleep(PERIOD_S)
