"""What robot-drive, worker and guard together, needs: while it is driven, and without a driver."""

import time
from typing import Final

import psutil

from bench.drive.ground import Ground, driver
from bench.processes import cpu_seconds
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row

ROUNDS: Final = FEWEST_ROUNDS
WINDOW_S: Final = 6.0
SETTLE_S: Final = 1.0


def rows(ground: Ground, wanted: set[str]) -> list[Row]:
    driven, idle = [], []
    with ground.robot() as robot:
        for _ in range(ROUNDS):
            with driver(robot.target):
                driven.append(cpu_percent(ground, WINDOW_S))
            time.sleep(SETTLE_S)
            idle.append(cpu_percent(ground, WINDOW_S))
            log(f"robot-drive: {driven[-1]:.2f} % of a core driven, {idle[-1]:.2f} % without a driver")
    made = [
        Row(
            name="drive.cpu",
            what="CPU of robot-drive, worker and guard, while a driver moves the robot",
            unit="% of a core",
            values=driven,
            bar=8,
        ),
        Row(
            name="drive.cpu_idle",
            what="the same without a driver",
            unit="% of a core",
            values=idle,
            bar=None,
        ),
    ]
    return [row for row in made if row.name in wanted]


def cpu_percent(ground: Ground, window_s: float) -> float:
    """Returns the CPU time of both processes in the coming seconds, in percent of a core."""
    guard = ground.drive.process.pid
    pids = [guard, *(child.pid for child in psutil.Process(guard).children())]
    before_s, began_s = sum(map(cpu_seconds, pids)), time.monotonic()
    time.sleep(window_s)
    return (sum(map(cpu_seconds, pids)) - before_s) / (time.monotonic() - began_s) * 100
