"""Capture to decoded, without the SRT latency; and how long a viewer waits for its first picture."""

import random
import statistics
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.rows import Row
from bench.video import product, reference
from bench.video.camera import camera
from bench.video.progress import tell
from bench.video.viewing import Connect, first_frame_ms, watch
from tests.support.ports import free_udp_port

FIRST_FRAME_AT_MS = 125
"""SRT latency of the row on first pictures: the one robots use."""
ROUNDS = 3
JOINS = 4
SETTLE_S = 1.0
WATCH_S = 4.0
_PAUSE_S = (0.6, 1.2)
"""Between joins: never in step with key frames, and as far apart as viewers come."""


@dataclass(frozen=True, slots=True)
class Round:
    """What one round of one side came to, in ms."""

    excess: float
    first_frame: float


def rows(workdir: Path, latency_ms: int) -> list[Row]:
    with camera(workdir) as source, product.robot(workdir, source, latency_ms) as robot:
        port = free_udp_port()

        def reference_side() -> AbstractContextManager[Any]:
            return reference.sender(source, port, latency_ms)

        theirs, ours = [], []
        for _ in range(ROUNDS):
            theirs.append(
                _round(
                    reference_side, lambda: reference.PlainViewer(port, latency_ms), latency_ms, "reference"
                )
            )
            ours.append(_round(robot.preview, robot.viewer, latency_ms, "ours"))
    excess, first_frame = [
        Row(
            name=f"video.excess_latency_{latency_ms}",
            what=f"capture to decoded, median, beyond the SRT latency of {latency_ms} ms (720p30)",
            unit="ms",
            value=statistics.median(each.excess for each in ours),
            reference=statistics.median(each.excess for each in theirs),
            bar=0.40,
        ),
        Row(
            name="video.first_frame",
            what=f"viewer connects to a running stream, to its first picture (SRT {latency_ms} ms)",
            unit="ms",
            value=statistics.median(each.first_frame for each in ours),
            reference=statistics.median(each.first_frame for each in theirs),
            bar=0.30,
        ),
    ]
    return [excess, first_frame] if latency_ms == FIRST_FRAME_AT_MS else [excess]


def _round(
    sending: Callable[[], AbstractContextManager[Any]], connect: Connect, latency_ms: int, name: str
) -> Round:
    with sending():
        with connect() as viewer:
            watch(viewer, SETTLE_S)
            latency = statistics.median(glance.latency_ms for glance in watch(viewer, WATCH_S))
        joins = []
        for _ in range(JOINS):
            time.sleep(random.uniform(*_PAUSE_S))
            joins.append(first_frame_ms(connect))
    found = Round(latency - latency_ms, statistics.median(joins))
    each = ", ".join(f"{one:.0f}" for one in joins)
    tell(f"SRT {latency_ms} ms, {name}: {found.excess:.1f} ms beyond it; first pictures after {each} ms")
    return found
