"""The monitor window with live video: how long a key or click waits for the event loop."""

import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from bench.progress import log
from bench.rows import Row
from bench.video.camera import camera
from bench.video.product import Robot, robot

ROUNDS = 5
MEASURE_S = 8.0
FPS = 30
_LATENCY_MS = 125
_SIZES = {
    "monitor.loop_delay_p99_ms": ("as it opens, 1280x800", 1280, 800),
    "monitor.loop_delay_p99_full_ms": ("on a whole screen, 1920x1080", 1920, 1080),
}


def run(names: list[str]) -> list[Row]:
    wanted = {name: size for name, size in _SIZES.items() if not names or name in names}
    with tempfile.TemporaryDirectory() as directory:
        workdir = Path(directory)
        with camera(workdir, FPS) as source, robot(workdir, source, _LATENCY_MS) as found, found.preview():
            return [_row(found, name, *size) for name, size in wanted.items()]


def _row(found: Robot, name: str, what: str, width: int, height: int) -> Row:
    delays_ms, painted_fps = [], []
    for number in range(ROUNDS):
        log(f"monitor: round {number + 1} of {ROUNDS}, {what}")
        answer = _measure(found, width, height)
        painted_fps.append(answer["frames"] / MEASURE_S)
        delays_ms.append(statistics.quantiles(answer["delays_ms"], n=100)[98])
    if min(painted_fps) < 0.9 * FPS:
        raise RuntimeError(f"only {min(painted_fps):.1f} frames a second were painted: nothing was measured")
    fps = statistics.median(painted_fps)
    return Row(
        name=name,
        what=f"wait for the window's event loop, 99th percentile, {fps:.1f} fps painted, {what}",
        unit="ms",
        values=delays_ms,
        bar=30.0,
    )


def _measure(found: Robot, width: int, height: int) -> Any:
    """Returns the delays of the event loop and the number of frames painted in one round."""
    ended = subprocess.run(
        [
            sys.executable,
            "-m",
            "bench.monitor_process",
            found.client.target,
            str(MEASURE_S),
            str(width),
            str(height),
        ],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        timeout=120,
    )
    answer = json.loads(ended.stdout)
    if not answer:
        raise RuntimeError("no frame was painted")
    return answer
