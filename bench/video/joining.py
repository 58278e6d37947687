"""How long a viewer of a running stream waits for its first frame.

The reference's viewer waits for the next key frame, so its figure depends on when it calls. All moments
between two key frames are equally likely: here the calls are spread evenly over them, from a random first.
"""

import random
import statistics
import time
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from bench.progress import log
from bench.rows import Row
from bench.video import product, reference
from bench.video.camera import camera
from bench.video.viewing import Connect, first_frame_ms, watch
from tests.support.free import free_udp_port

ROUNDS = 5
JOINS = 8
LATENCY_MS = 125
SETTLE_S = 1.0
APART_S = reference.KEY_FRAMES_APART_S * (2 + 1 / JOINS)
"""From one call to the next: two distances of key frames, so that a frame came meanwhile, and a share."""


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    theirs: list[float] = []
    ours: list[float] = []
    with camera(workdir) as source, product.robot(workdir, source, LATENCY_MS) as robot:
        port = free_udp_port()

        def reference_viewer() -> AbstractContextManager[Any]:
            return reference.viewer(port, LATENCY_MS)

        for _ in range(ROUNDS):
            sending = reference.sender(source, port, LATENCY_MS)
            theirs.append(statistics.median(_joins(sending, reference_viewer, "reference")))
            ours.append(statistics.median(_joins(robot.preview(), robot.viewer, "ours")))
    return [
        Row(
            name="video.first_frame",
            what=f"viewer connects to a running stream, to its first frame (SRT {LATENCY_MS} ms)",
            unit="ms",
            values=ours,
            references=theirs,
            bar=0.30,
        )
    ]


def _joins(sending: AbstractContextManager[Any], connect: Connect, name: str) -> list[float]:
    """The waits of one round, in ms."""
    with sending:
        with connect() as viewer:
            watch(viewer, SETTLE_S)
        begin_s = time.monotonic() + random.uniform(0, reference.KEY_FRAMES_APART_S)
        waits = []
        for number in range(JOINS):
            time.sleep(max(0.0, begin_s + number * APART_S - time.monotonic()))
            waits.append(first_frame_ms(connect))
    log(f"{name}: first frames after {', '.join(f'{one:.0f}' for one in waits)} ms")
    return waits
