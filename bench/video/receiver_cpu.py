"""CPU of a viewer without a window for each frame: direct delivery against SRT's own, at once, of one stream.

A viewer that loses frames needs less, so a round in which either misses too many is discarded. So is one in
which either catches up on frames from before: there were more than the camera has. A viewer that has started
too late to see two frames has no rate at all.
"""

import json
import math
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.processes import cpu_seconds
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, MeasurementError, Row
from bench.video import product
from bench.video.camera import camera
from console.receiver.delivery import DeliveryChoice

ROUNDS: Final = FEWEST_ROUNDS
TRIES: Final = 2 * ROUNDS
"""Rounds at most, to get that many that count."""
SETTLE_S: Final = 3.0
WATCH_S: Final = 10.0
LATENCY_MS: Final = 125
FPS: Final = 30
LEAST_DELIVERED: Final = 0.99
MOST_DELIVERED: Final = 1.02
_ENDS_WITHIN_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class Viewed:
    """What one viewer needed, and what it saw from its first frame to its last."""

    ms_per_frame: float
    fps: float

    @property
    def is_complete(self) -> bool:
        """Whether it saw the camera's frames of this time, neither fewer nor more."""
        return LEAST_DELIVERED * FPS <= self.fps <= MOST_DELIVERED * FPS

    def __str__(self) -> str:
        return f"{self.ms_per_frame:.2f} ms a frame at {self.fps:.1f} fps"


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    direct: list[float] = []
    srt: list[float] = []
    discarded = 0
    with camera(workdir, FPS) as source, product.robot(workdir, source, LATENCY_MS) as robot, robot.preview():
        while len(direct) < ROUNDS:
            if len(direct) + discarded == TRIES:
                raise MeasurementError(
                    f"frames were missing or delayed in {discarded} rounds: the machine is too busy"
                )
            ours, theirs = one_round(robot.client.target)
            complete = ours.is_complete and theirs.is_complete
            log(f"direct: {ours}; SRT's own: {theirs}{'' if complete else '; discarded'}")
            if complete:
                direct.append(ours.ms_per_frame)
                srt.append(theirs.ms_per_frame)
            else:
                discarded += 1
    return [
        Row(
            name="video.receiver_cpu",
            what="CPU of robotctl view --headless for each frame, direct delivery against SRT's own, at once"
            " (720p30)",
            unit="ms",
            values=direct,
            references=srt,
            discarded=discarded,
            bar=1.15,
        )
    ]


def one_round(target: str, settle_s: float = SETTLE_S, watch_s: float = WATCH_S) -> tuple[Viewed, Viewed]:
    """Returns what a viewer with direct delivery needs, and one with SRT's own."""
    robotctl = [str(Path(sys.executable).parent / "robotctl"), "--json", "view", "--headless"]
    viewers: list[subprocess.Popen[str]] = []
    with ExitStack() as stack:
        for choice in (DeliveryChoice.DIRECT, DeliveryChoice.SRT):
            command = [*robotctl, "--target", target, "--delivery", choice.value]
            viewers.append(stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True)))
            stack.callback(viewers[-1].terminate)
        time.sleep(settle_s)
        before_s = [cpu_seconds(each.pid) for each in viewers]
        begun_s = time.monotonic()
        time.sleep(watch_s)
        spent_s = [cpu_seconds(each.pid) - before for each, before in zip(viewers, before_s, strict=True)]
        passed_s = time.monotonic() - begun_s
        direct, srt = (_viewed(each, spent / passed_s) for each, spent in zip(viewers, spent_s, strict=True))
        return direct, srt


def _viewed(viewer: "subprocess.Popen[str]", share: float) -> Viewed:
    """Ends a viewer.

    Args:
        viewer: `robotctl --json view --headless`.
        share: of a core that it needed.
    """
    viewer.send_signal(signal.SIGINT)
    summary, _ = viewer.communicate(timeout=_ENDS_WITHIN_S)
    fps: float | None = json.loads(summary)["fps"]
    return Viewed(1000 * share / fps, fps) if fps else Viewed(math.inf, 0.0)
