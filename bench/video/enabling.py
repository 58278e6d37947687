"""An operator switches the preview on and watches: how long until the first frame."""

import time
from pathlib import Path

from bench.progress import log
from bench.rows import Row
from bench.video import product
from bench.video.camera import camera
from bench.video.viewing import PATIENCE_S, capture_time

ROUNDS = 7
LATENCY_MS = 125


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    with camera(workdir) as source, product.robot(workdir, source, LATENCY_MS) as robot:
        times_ms = [_once(robot) for _ in range(ROUNDS)]
    return [
        Row(
            name="video.enable_to_frame_ms",
            what=f"SetPreviewMode sent, to the first decoded frame (SRT {LATENCY_MS} ms)",
            unit="ms",
            values=times_ms,
            bar=450,
        )
    ]


def _once(robot: product.Robot) -> float:
    """One enable, in ms; the way of the frame step by step on standard error."""
    sent_s = time.monotonic()
    with robot.preview():
        answered_s = time.monotonic()
        with robot.viewer() as viewer:
            frame = viewer.next_frame(PATIENCE_S)
    captured_s = capture_time(frame)
    steps = [
        ("SetPreviewMode answered, preview RUNNING, viewer calls", answered_s),
        ("first frame captured", captured_s),
        ("decoded", frame.arrival_s),
    ]
    line = "; ".join(f"{at_s - sent_s:.3f} s {what}" for what, at_s in steps if at_s is not None)
    log(f"enable: {line}")
    return (frame.arrival_s - sent_s) * 1000
