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


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    found: list[Row] = []
    if "video.excess_latency_20" in wanted:
        theirs, ours = _measure(workdir, 20)
        found.append(_excess(20, theirs, ours))
    if wanted & {"video.excess_latency_125", "video.first_frame"}:
        theirs, ours = _measure(workdir, 125)
        found += [_excess(125, theirs, ours), _first_frame(125, theirs, ours)]
    return [row for row in found if row.name in wanted]


def _measure(workdir: Path, latency_ms: int) -> tuple[list[Round], list[Round]]:
    """The rounds of the reference and ours."""
    theirs, ours = [], []
    with camera(workdir) as source, product.robot(workdir, source, latency_ms) as robot:
        port = free_udp_port()

        def reference_sender() -> AbstractContextManager[Any]:
            return reference.sender(source, port, latency_ms)

        def reference_viewer() -> reference.PlainViewer:
            return reference.PlainViewer(port, latency_ms)

        for _ in range(ROUNDS):
            theirs.append(_round(reference_sender, reference_viewer, latency_ms, "reference"))
            ours.append(_round(robot.preview, robot.viewer, latency_ms, "ours"))
    return theirs, ours


def _excess(latency_ms: int, theirs: list[Round], ours: list[Round]) -> Row:
    return Row(
        name=f"video.excess_latency_{latency_ms}",
        what=f"capture to decoded, median, beyond the SRT latency of {latency_ms} ms (720p30)",
        unit="ms",
        value=statistics.median(each.excess for each in ours),
        reference=statistics.median(each.excess for each in theirs),
        bar=0.40,
    )


def _first_frame(latency_ms: int, theirs: list[Round], ours: list[Round]) -> Row:
    return Row(
        name="video.first_frame",
        what=f"viewer connects to a running stream, to its first picture (SRT {latency_ms} ms)",
        unit="ms",
        value=statistics.median(each.first_frame for each in ours),
        reference=statistics.median(each.first_frame for each in theirs),
        bar=0.30,
    )


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
