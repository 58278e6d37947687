"""One decoded video frame."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum


class PixelFormat(Enum):
    """Memory layout of a frame's pixels; the values are GStreamer's names."""

    I420 = "I420"
    """A plane of luma, then two of chroma at half the size: what decoders produce."""
    BGRX = "BGRx"
    """One plane, four bytes a pixel: what screens take."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A decoded frame.

    The pixels stay in GStreamer's memory until they are read, and are copied once then.

    Args:
        width: in pixels.
        height: in pixels.
        codec: of the stream, "h264" or "h265".
        pts_ns: the sender's presentation time as the demultiplexer gives it; None when it gave none.
        arrival_s: when the decoder delivered it, on `time.monotonic()`.
        corrupt: whether it is torn: packets of it, or of a frame that it depends on, were lost. False with
            direct delivery, which shows no such frame.
        stride: from one row of the first plane (I420: luma) to the next, in bytes.
        read: copies all its pixels, the first plane first.
        decoder: GStreamer's element that decoded it.
        capture_ns: when the camera took it, on the robot's monotonic clock; None while that is unknown.
        received_s: when it was complete and in its turn, on `time.monotonic()`; None with SRT's own delivery.
    """

    width: int
    height: int
    codec: str
    pts_ns: int | None
    arrival_s: float
    corrupt: bool
    stride: int
    read: Callable[[], bytes] = field(repr=False)
    decoder: str = ""
    capture_ns: int | None = None
    received_s: float | None = None
