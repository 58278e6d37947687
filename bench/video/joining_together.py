"""Ten viewers join a running stream at once: how long the slowest waits, and how many key frames it takes.

They are to share key frames, because requested ones are at least 300 ms apart; the encoder makes none by
itself meanwhile. The listener's queue of connections (srtsink: a backlog of 1) may refuse some, and these
connect again: the viewers are the sessions that every window of the console has, which redial by themselves.
"""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product
from bench.video.camera import camera
from bench.video.viewing import PATIENCE_S
from console.receiver.frame import Frame, PixelFormat
from console.viewer.session import VideoSession
from tests.support.mpegts import analyse
from tests.support.recording import record
from tests.support.waiting import wait_until

ROUNDS: Final = FEWEST_ROUNDS
VIEWERS: Final = 10
LATENCY_MS: Final = 125
OBSERVED_S: Final = 4.0
"""The observer is there before them and stays until they have joined."""
KEY_FRAMES: Final = 3
"""One at once, one 300 ms later, and one for those whose connection was refused until then."""
SLOWEST_MS: Final = 800
"""Two distances of key frames, a redial, and the 80 ms of a viewer that joins alone."""
SETTINGS: Final = {"encoders": {"order": ["x264"], "key_frame_interval_s": 30}}


@dataclass(frozen=True, slots=True)
class Joined:
    """One round.

    Args:
        slowest_ms: of the slowest viewer, to its first frame.
        key_frames: that the stream had for all of them.
    """

    slowest_ms: float
    key_frames: int


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
    with (
        camera(workdir) as source,
        product.robot(workdir, source, LATENCY_MS, settings=SETTINGS) as robot,
    ):
        found = [one_round(robot) for _ in range(ROUNDS)]
    what = f"{VIEWERS} viewers join at once, direct delivery"
    return [
        Row(
            name="video.first_frame_ten_ms",
            what=f"{what}: to the first frame of the slowest",
            unit="ms",
            values=[each.slowest_ms for each in found],
            bar=SLOWEST_MS,
            judged="worst",
        ),
        Row(
            name="video.first_frame_ten_key_frames",
            what=f"{what}: key frames that are made for them",
            unit="",
            values=[each.key_frames for each in found],
            bar=KEY_FRAMES,
            judged="worst",
        ),
    ]


def one_round(robot: product.Robot, viewers: int = VIEWERS) -> Joined:
    """Lets viewers join at once, beside one that observes the stream."""
    waits = [_Wait() for _ in range(viewers)]
    sessions = [VideoSession(pixels=PixelFormat.I420) for _ in waits]
    with robot.preview(), ThreadPoolExecutor(1) as observer, ExitStack() as stack:
        recording = observer.submit(record, robot.address.port, OBSERVED_S)
        wait_until(lambda: robot.client.status().preview.measured.viewer_count == 1, "the observer")
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
        if recording.done():
            raise RuntimeError(f"the observer left before, {OBSERVED_S:g} s after it had come")
        took_ms = sorted((wait.arrival_s - begun_s) * 1000 for wait in waits)
        redials = sum(session.redials for session in sessions)
        # The first one is the observer's own.
        key_frames = sum(unit.key for unit in analyse(recording.result()).access_units) - 1
    log(
        f"{viewers} together: {', '.join(f'{one:.0f}' for one in took_ms)} ms; {redials} connected again,"
        f" {key_frames} key frames"
    )
    return Joined(took_ms[-1], key_frames)
