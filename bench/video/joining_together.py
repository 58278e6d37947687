"""Ten viewers join a running stream at once: how long the slowest of them waits for its first frame.

They share one key frame, because requested key frames are at least 300 ms apart. The listener's queue of
connections (srtsink: a backlog of 1) may refuse some, and these connect again: the viewers are the sessions
that every window of the console has, which redial by themselves.
"""

import threading
import time
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product
from bench.video.camera import camera
from bench.video.viewing import PATIENCE_S, watch
from console.receiver.frame import Frame, PixelFormat
from console.viewer.session import VideoSession

ROUNDS: Final = FEWEST_ROUNDS
VIEWERS: Final = 10
LATENCY_MS: Final = 125
SETTLE_S: Final = 1.0


class _Wait:
    """Time of a session's first frame."""

    def __init__(self) -> None:
        self.arrival_s = 0.0
        self.over = threading.Event()

    def note(self, frame: Frame) -> None:
        if not self.over.is_set():
            self.arrival_s = frame.arrival_s
            self.over.set()


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    with camera(workdir) as source, product.robot(workdir, source, LATENCY_MS) as robot:
        slowest_ms = [_round(robot) for _ in range(ROUNDS)]
    return [
        Row(
            name="video.first_frame_ten_ms",
            what=f"{VIEWERS} viewers join at once, to the first frame of the slowest (SRT {LATENCY_MS} ms)",
            unit="ms",
            values=slowest_ms,
            bar=None,
            judged="worst",
        )
    ]


def _round(robot: product.Robot) -> float:
    """Returns the wait of the slowest viewer, in ms."""
    waits = [_Wait() for _ in range(VIEWERS)]
    sessions = [VideoSession(pixels=PixelFormat.I420) for _ in waits]
    with robot.preview(), ExitStack() as stack:
        with robot.viewer() as viewer:
            watch(viewer, SETTLE_S)
        status = robot.client.status().preview
        for session, wait in zip(sessions, waits, strict=True):
            session.add_frame_listener(wait.note)
            session.start()
            stack.enter_context(closing(session))
        begun_s = time.monotonic()
        for session in sessions:
            session.follow(status)
        for wait in waits:
            if not wait.over.wait(PATIENCE_S):
                raise RuntimeError(f"a viewer had no frame within {PATIENCE_S:g} s")
        took_ms = sorted((wait.arrival_s - begun_s) * 1000 for wait in waits)
        redials = sum(session.redials for session in sessions)
    log(f"{VIEWERS} together: {', '.join(f'{one:.0f}' for one in took_ms)} ms; {redials} connected again")
    return took_ms[-1]
