"""The monitor window with live video: how long the event loop keeps an operator's key or click waiting."""

import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from bench.rows import Row
from bench.video.camera import camera
from bench.video.product import Robot, robot

MEASURE_S = 20.0
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
    print(f"monitor: {MEASURE_S:g} s {what}", file=sys.stderr)
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
    painted_fps = answer["frames"] / MEASURE_S
    if painted_fps < 0.9 * FPS:
        raise RuntimeError(f"only {painted_fps:.1f} frames a second were painted: nothing was measured")
    return Row(
        name=name,
        what=f"wait for the window's event loop, 99th percentile, {painted_fps:.1f} fps painted, {what}",
        unit="ms",
        value=statistics.quantiles(answer["delays_ms"], n=100)[98],
        reference=None,
        bar=30.0,
    )
