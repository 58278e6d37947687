"""Capture to decoded of the H.265 path, beyond the SRT latency: x265 in the preview service, our receiver.

In software, because the machine has no hardware encoder: what it adds is the encoder's own time, which a
robot's hardware does not take.
"""

from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product
from bench.video.camera import camera
from bench.video.viewing import watch, watch_window

ROUNDS: Final = FEWEST_ROUNDS
SETTLE_S: Final = 2.0
WATCH_S: Final = 6.0
LATENCY_MS: Final = 125


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    settings = {"encoders": {"order": ["x265"]}}
    excess_ms: list[float] = []
    delivered_percent: list[float] = []
    with camera(workdir) as source, product.robot(workdir, source, LATENCY_MS, settings=settings) as robot:
        for _ in range(ROUNDS):
            with robot.preview(), robot.viewer() as viewer:
                watch(viewer, SETTLE_S)
                window = watch_window(viewer, WATCH_S)
            captured = source.captured(window.from_s, window.until_s)
            delivered_percent.append(window.delivered_percent(captured))
            excess_ms.append(window.median_ms - LATENCY_MS)
            late = f"{excess_ms[-1]:.1f} ms beyond the SRT latency"
            log(f"H.265: {late}, {delivered_percent[-1]:.1f} % delivered")
    return [
        Row(
            name="video.excess_h265_ms",
            what=f"H.265 by x265: capture to decoded beyond the SRT latency of {LATENCY_MS} ms, median",
            unit="ms",
            values=excess_ms,
            bar=33,
        ),
        Row(
            name="video.excess_h265_delivered_percent",
            what="H.265 by x265: frames decoded whole, of those that the camera took",
            unit="%",
            values=delivered_percent,
            bar=99,
            better="higher",
        ),
    ]
