"""Half an hour of enable, join, switch, leave, disable: what the preview service keeps of it.

Not part of a run without names: `scripts/bench soak`; `python -m bench.soak --minutes 8` is a shorter one.
Memory and descriptors are read while the preview is off. libsrt keeps closed sockets and their buffers for
some seconds, and several rounds pass in each of these: so what is kept first grows to a level that depends on
the pace, and moves about it. The second tenth of the rounds is compared with the last one, the lowest figure
of each: a leak raises that one, too.
"""

import argparse
import sys
import tempfile
import time
from itertools import cycle
from pathlib import Path

from rich.console import Console

from bench import report
from bench.processes import resident_mib
from bench.progress import log
from bench.rows import Row
from bench.soak_readings import Reading, judge
from bench.video import product
from bench.video.camera import camera
from bench.video.viewing import PATIENCE_S
from console.client import PreviewProfile

MINUTES = 30.0
FEWEST_ROUNDS = 100
"""A tenth of them is a window."""
LATENCY_MS = 20
_LOG_EVERY_ROUNDS = 25
_PROFILES = (PreviewProfile.LOW_BW, PreviewProfile.BALANCED, PreviewProfile.HIGH_QUALITY)


def run(names: list[str], minutes: float = MINUTES) -> list[Row]:
    with (
        tempfile.TemporaryDirectory() as workdir,
        camera(Path(workdir)) as source,
        product.robot(Path(workdir), source, LATENCY_MS) as robot,
    ):
        readings = _live(robot, minutes * 60)
    rows = judge(readings, minutes)
    return [row for row in rows if not names or row.name in names]


def _live(robot: product.Robot, seconds: float) -> list[Reading]:
    """Rounds until the time is over; at least as many as a judgement needs."""
    until_s = time.monotonic() + seconds
    readings: list[Reading] = []
    profiles = cycle(_PROFILES)
    while time.monotonic() < until_s or len(readings) < FEWEST_ROUNDS:
        _round(robot, next(profiles), next(profiles))
        readings.append(_read(robot.service.pid))
        if len(readings) % _LOG_EVERY_ROUNDS == 0:
            mib, descriptors = readings[-1].resident_mib, readings[-1].descriptors
            log(f"soak: round {len(readings)}, {mib:.1f} MiB, {descriptors} descriptors")
    return readings


def _round(robot: product.Robot, first: PreviewProfile, second: PreviewProfile) -> None:
    """One viewer stays from the beginning to the end, another one comes and goes after a switch."""
    with robot.preview(first), robot.viewer() as staying:
        staying.next_frame(PATIENCE_S)
        robot.client.enable_preview(second)
        with robot.viewer() as passing:
            passing.next_frame(PATIENCE_S)
        staying.next_frame(PATIENCE_S)


def _read(pid: int) -> Reading:
    return Reading(resident_mib(pid), len(list(Path(f"/proc/{pid}/fd").iterdir())))


def main() -> int:
    """Ends 0 when nothing grew, 1 when something did."""
    parser = argparse.ArgumentParser(prog="python -m bench.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=MINUTES)
    rows = run([], parser.parse_args().minutes)
    Console(width=200).print(report.table(rows))
    return 0 if all(row.ok for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
