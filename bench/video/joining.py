"""How long a viewer of a running stream waits for its first frame.

The reference's viewer waits for the next key frame, so its figure depends on when it connects. All moments
between two key frames are equally likely: here the connections are spread evenly over them, from a random
first.
"""

import random
import statistics
import time
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product, reference
from bench.video.camera import Camera, camera
from bench.video.viewing import Connect, first_frame_ms, watch
from console.receiver.options import ReceiverOptions
from tests.support.free import free_udp_port

ROUNDS: Final = FEWEST_ROUNDS
JOINS: Final = 8
LATENCY_MS: Final = 125
SETTLE_S: Final = 1.0
APART_S: Final = reference.KEY_FRAMES_APART_S * (2 + 1 / JOINS)
"""Between connections: two distances of key frames, so that a frame came meanwhile, and a share of one."""


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    theirs_ms: list[float] = []
    direct_ms: list[float] = []
    srt_ms: list[float] = []
    with camera(workdir) as source, product.robot(workdir, source, LATENCY_MS) as robot:
        for _ in range(ROUNDS):
            if "video.first_frame" in wanted:
                theirs_ms.append(_reference_ms(source))
            if wanted & {"video.first_frame", "video.first_frame_ms"}:
                direct_ms.append(_ours_ms(robot, product.DIRECT_DELIVERY))
            if "video.first_frame_srt_ms" in wanted:
                srt_ms.append(_ours_ms(robot, product.SRT_DELIVERY))
    return [
        *(_direct_rows(direct_ms, theirs_ms) if direct_ms else ()),
        *([_srt_row(srt_ms)] if srt_ms else ()),
    ]


def _direct_rows(direct_ms: list[float], theirs_ms: list[float]) -> list[Row]:
    what = "viewer connects to a running stream, to its first frame, direct delivery"
    found = [Row(name="video.first_frame_ms", what=what, unit="ms", values=direct_ms, bar=80)]
    if theirs_ms:
        found.append(
            Row(
                name="video.first_frame",
                what=f"{what}, against the usual pipeline (SRT {LATENCY_MS} ms)",
                unit="ms",
                values=direct_ms,
                references=theirs_ms,
                bar=0.30,
            )
        )
    return found


def _srt_row(srt_ms: list[float]) -> Row:
    return Row(
        name="video.first_frame_srt_ms",
        what=f"the same at an SRT latency of {LATENCY_MS} ms, as in any other SRT player",
        unit="ms",
        values=srt_ms,
        bar=200,
    )


def _reference_ms(source: Camera) -> float:
    port = free_udp_port()
    sending = reference.sender(source, port, LATENCY_MS)
    return statistics.median(_joins(sending, lambda: reference.viewer(port, LATENCY_MS), "reference"))


def _ours_ms(robot: product.Robot, options: ReceiverOptions) -> float:
    delivery = options.delivery.value
    return statistics.median(_joins(robot.preview(), lambda: robot.viewer(options), f"ours, {delivery}"))


def _joins(sending: AbstractContextManager[Any], connect: Connect, name: str) -> list[float]:
    """Returns the waits of one round, in ms."""
    with sending:
        with connect() as viewer:
            watch(viewer, SETTLE_S)
        begin_s = time.monotonic() + random.uniform(0, reference.KEY_FRAMES_APART_S)
        waits_ms = []
        for number in range(JOINS):
            time.sleep(max(0.0, begin_s + number * APART_S - time.monotonic()))
            waits_ms.append(first_frame_ms(connect))
    log(f"{name}: first frames after {', '.join(f'{one:.0f}' for one in waits_ms)} ms")
    return waits_ms
