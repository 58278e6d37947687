"""An operator enables the preview and watches: how long until the first frame.

Warm: the preview has been enabled before. Cold: the first time after the service's own start, with a new
process in every round; an encoder's trial may still be under way then.
"""

import time
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product
from bench.video.camera import Camera, camera
from bench.video.viewing import PATIENCE_S, capture_time

ROUNDS: Final = 7
COLD_ROUNDS: Final = FEWEST_ROUNDS
LATENCY_MS: Final = 125


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    found = []
    with camera(workdir) as source:
        if "video.enable_to_frame_ms" in wanted:
            found.append(_warm(workdir, source))
        if "video.cold_enable_ms" in wanted:
            found.append(_cold(workdir, source))
    return found


def _warm(workdir: Path, source: Camera) -> Row:
    with product.robot(workdir, source, LATENCY_MS) as robot:
        times_ms = [_once(robot) for _ in range(ROUNDS)]
    return Row(
        name="video.enable_to_frame_ms",
        what="SetPreviewMode sent, to the first decoded frame, direct delivery",
        unit="ms",
        values=times_ms,
        bar=120,
    )


def _cold(workdir: Path, source: Camera) -> Row:
    times_ms = []
    for _ in range(COLD_ROUNDS):
        with product.robot(workdir, source, LATENCY_MS, warm=False) as robot:
            times_ms.append(_once(robot))
    return Row(
        name="video.cold_enable_ms",
        what="the same, the first time after the start of the preview service",
        unit="ms",
        values=times_ms,
        bar=400,
    )


def _once(robot: product.Robot) -> float:
    """Returns the time of one enable, in ms; logs its steps."""
    sent_s = time.monotonic()
    with robot.preview():
        answered_s = time.monotonic()
        with robot.viewer(product.DIRECT_DELIVERY) as viewer:
            frame = viewer.next_frame(PATIENCE_S)
    captured_s = capture_time(frame)
    steps = [
        ("SetPreviewMode answered, preview RUNNING, viewer connects", answered_s),
        ("first frame captured", captured_s),
        ("decoded", frame.arrival_s),
    ]
    line = "; ".join(f"{at_s - sent_s:.3f} s {what}" for what, at_s in steps if at_s is not None)
    log(f"enable: {line}")
    return (frame.arrival_s - sent_s) * 1000
