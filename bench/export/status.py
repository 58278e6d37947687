"""What exports cost a caller who asks for the status: its 99th percentile, against without exports."""

import time
from contextlib import ExitStack
from typing import Any, Final

import grpc

from bench.calling import OWN_CONNECTION
from bench.export.copying import copier
from bench.export.ground import ExportingRobot
from bench.progress import log
from bench.rows import Row
from bench.watch import p99, took_ms
from bench.watch_load import SERVICE

TURNS: Final = 6
BAR: Final = 1.3
"""With a limit or without: the promise names none."""
COPIERS: Final = 2
LIMIT_MIB_S: Final = 4
"""Of each: together 67 Mbit/s, what a good wireless link carries."""
_SETTLE_S: Final = 1.0


def rows(robot: ExportingRobot, wanted: set[str]) -> list[Row]:
    made = []
    each_limited = f"{COPIERS} exports of {LIMIT_MIB_S} MiB/s each run"
    for name, limit, load in (
        ("export.status_p99", LIMIT_MIB_S * 1024 * 1024, each_limited),
        ("export.status_p99_unlimited", 0, "one export without a limit runs, over loopback"),
    ):
        if name not in wanted:
            continue
        alone, beside = [], []
        for number in range(TURNS):
            quiet, loaded = one_turn(robot, limit, COPIERS if limit else 1)
            alone.append(quiet)
            beside.append(loaded)
            log(f"{name}: turn {number + 1}, {loaded:.2f} ms against {quiet:.2f} ms without exports")
        made.append(
            Row(
                name=name,
                what=f"GetSystemStatus, 99th percentile while {load}, against without exports, in turns",
                unit="ms",
                values=beside,
                references=alone,
                bar=BAR,
            )
        )
    return made


def one_turn(robot: ExportingRobot, max_bytes_per_s: int, copiers: int) -> tuple[float, float]:
    """Returns the 99th percentile without and with exports, in ms."""
    with grpc.insecure_channel(robot.target, options=OWN_CONNECTION) as channel:
        call: Any = channel.unary_unary(f"{SERVICE}/GetSystemStatus")
        call(b"", wait_for_ready=True)
        alone = p99(took_ms(call))
        with ExitStack() as exports:
            for _ in range(copiers):
                exports.enter_context(copier(robot.target, robot.streams(max_bytes_per_s)))
            time.sleep(_SETTLE_S)
            return alone, p99(took_ms(call))
