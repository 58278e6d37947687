"""What one more robot costs a server: memory of its connection, and CPU time of its state at 1 Hz.

With 1000 robots against 100: flat means that a robot of a large fleet costs what one of a small fleet does.
"""

import asyncio
import time
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
    cpu_percent: float


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
            name="fleet.robot_cpu",
            what=f"CPU time of the server for each robot: {against}",
            unit="% of a core",
            values=[each.cpu_percent for each in many],
            references=[each.cpu_percent for each in few],
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
            reporting = [tasks.create_task(_report(hub, f"r{number}")) for number, hub in enumerate(hubs)]
            await asyncio.sleep(PERIOD_S)  # every robot has reported once
            before_s, begun_s = cpu_seconds(pid), time.monotonic()
            await asyncio.sleep(WINDOW_S)
            cpu_s, passed_s = cpu_seconds(pid) - before_s, time.monotonic() - begun_s
            full_mib = resident_mib(pid)
            for each in reporting:
                each.cancel()
    return Cost((full_mib - empty_mib) * 1024 / robots, 100 * cpu_s / passed_s / robots)


async def _report(hub: Hub, robot: str) -> None:
    """A state a second, at an instant of the robot's own."""
    await asyncio.sleep(hash(robot) % 1000 / 1000 * PERIOD_S)
    while True:
        await hub.put(names.STATES, robot, b"x" * 400, 10)
        await asyncio.sleep(PERIOD_S)
