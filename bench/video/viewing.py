"""Watching a stream and recording when each frame was captured and when it was decoded."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Final, Protocol

from bench.rows import MeasurementError
from bench.video import stamp
from bench.video.window import Glance, Window
from console.receiver.frame import Frame

PATIENCE_S: Final = 15.0
_FEWEST_FRAMES: Final = 2
_AFTERWARDS_S: Final = 0.5
"""How long after a window its last frames are waited for."""


class Viewer(Protocol):
    """A receiver that is connected to a stream."""

    def next_frame(self, timeout_s: float) -> Frame:
        """Returns the next decoded frame."""


Connect = Callable[[], AbstractContextManager[Viewer]]
"""Connects a viewer; it disconnects when the block ends."""


def capture_time(frame: Frame, pixels: bytes | None = None) -> float | None:
    """Returns when a frame was captured, on `time.monotonic()`; None when its stamp can't be read.

    Args:
        frame: which.
        pixels: of it, where they were read already.
    """
    middle = stamp.BLOCK_PX // 2 * frame.stride
    return stamp.read((pixels or frame.read())[middle : middle + frame.stride])


def watch(viewer: Viewer, seconds: float) -> list[Glance]:
    """Returns the frames of the next `seconds`; those whose stamp can't be read are left out."""
    until_s = time.monotonic() + seconds
    glances = []
    while time.monotonic() < until_s:
        frame = viewer.next_frame(PATIENCE_S)
        captured_s = capture_time(frame)
        if captured_s is not None:
            glances.append(Glance(captured_s, frame.arrival_s, frame.corrupt))
    return glances


def watch_window(viewer: Viewer, seconds: float) -> Window:
    """Returns what arrives of the frames that are captured in the next `seconds`.

    Raises:
        MeasurementError: almost nothing does.
    """
    from_s = time.monotonic()
    window = Window.of(watch(viewer, seconds + _AFTERWARDS_S), from_s, from_s + seconds)
    if len(window.glances) < _FEWEST_FRAMES:
        raise MeasurementError(f"{len(window.glances)} whole frames in {seconds:g} s: nothing was measured")
    return window


def first_frame_ms(connect: Connect) -> float:
    """Returns the time from the begin of connecting to the first decoded frame, in ms."""
    begun_s = time.monotonic()
    with connect() as viewer:
        return (viewer.next_frame(PATIENCE_S).arrival_s - begun_s) * 1000
