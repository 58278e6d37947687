"""Capture to decoded, without the SRT latency."""

import statistics
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from bench.progress import log
from bench.rows import Row
from bench.video import product, reference
from bench.video.camera import camera
from bench.video.viewing import Connect, watch
from tests.support.free import free_udp_port

ROUNDS = 5
SETTLE_S = 1.0
WATCH_S = 4.0


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    return [
        _row(workdir, name, latency_ms)
        for latency_ms in (20, 125)
        if (name := f"video.excess_latency_{latency_ms}") in wanted
    ]


def _row(workdir: Path, name: str, latency_ms: int) -> Row:
    theirs, ours = [], []
    with camera(workdir) as source, product.robot(workdir, source, latency_ms) as robot:
        port = free_udp_port()

        def reference_viewer() -> reference.PlainViewer:
            return reference.PlainViewer(port, latency_ms)

        for _ in range(ROUNDS):
            sending = reference.sender(source, port, latency_ms)
            theirs.append(_excess_ms(sending, reference_viewer, latency_ms, "reference"))
            ours.append(_excess_ms(robot.preview(), robot.viewer, latency_ms, "ours"))
    return Row(
        name=name,
        what=f"capture to decoded, median, beyond the SRT latency of {latency_ms} ms (720p30)",
        unit="ms",
        values=ours,
        references=theirs,
        bar=0.40,
    )


def _excess_ms(sending: AbstractContextManager[Any], connect: Connect, latency_ms: int, name: str) -> float:
    """The median of one round."""
    with sending, connect() as viewer:
        watch(viewer, SETTLE_S)
        latency = statistics.median(glance.latency_ms for glance in watch(viewer, WATCH_S))
    log(f"SRT {latency_ms} ms, {name}: {latency - latency_ms:.1f} ms beyond it")
    return latency - latency_ms
