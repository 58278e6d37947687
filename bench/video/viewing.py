"""Watching a stream and noting when each frame was taken and when it was decoded."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

from bench.video import stamp
from console.receiver.frame import Frame

PATIENCE_S = 15.0


class Viewer(Protocol):
    """Who watches."""

    def next_frame(self, timeout_s: float) -> Frame:
        """The next decoded frame."""


Connect = Callable[[], AbstractContextManager[Viewer]]
"""Begins to watch."""


@dataclass(frozen=True, slots=True)
class Glance:
    """A frame's way, on `time.monotonic()`."""

    captured_s: float
    decoded_s: float
    corrupt: bool = False
    """Whether the decoder had to guess parts of it."""

    @property
    def latency_ms(self) -> float:
        """From capture to the end of decoding."""
        return (self.decoded_s - self.captured_s) * 1000


def capture_time(frame: Frame) -> float | None:
    """When it was captured, on `time.monotonic()`; None when its stamp can't be read."""
    middle = stamp.BLOCK_PX // 2 * frame.stride
    return stamp.read(frame.read()[middle : middle + frame.stride])


def watch(viewer: Viewer, seconds: float) -> list[Glance]:
    """What comes in the next `seconds`; frames whose stamp can't be read are left out."""
    until_s = time.monotonic() + seconds
    glances = []
    while time.monotonic() < until_s:
        frame = viewer.next_frame(PATIENCE_S)
        captured_s = capture_time(frame)
        if captured_s is not None:
            glances.append(Glance(captured_s, frame.arrival_s, frame.corrupt))
    return glances


def longest_gap_ms(glances: list[Glance]) -> float:
    """The longest time between two decoded frames."""
    return max(later.decoded_s - earlier.decoded_s for earlier, later in pairwise(glances)) * 1000


def first_frame_ms(connect: Connect) -> float:
    """From beginning to connect to the first decoded frame."""
    begun_s = time.monotonic()
    with connect() as viewer:
        return (viewer.next_frame(PATIENCE_S).arrival_s - begun_s) * 1000
