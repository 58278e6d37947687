"""One decoded video frame."""

from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol


class PixelFormat(Enum):
    """Memory layout of a frame's pixels; the values are GStreamer's names."""

    I420 = "I420"
    """A plane of luma, then two of chroma at half the size: what decoders produce."""
    BGRX = "BGRx"
    """One plane, four bytes a pixel: what screens take."""


class Pixels(Protocol):
    """Memory of a frame; a Gst.Buffer is one."""

    def extract_dup(self, offset: int, size: int, /) -> bytes:
        """Copies `size` bytes from `offset` on."""


@dataclass(frozen=True, slots=True)
class Plane:
    """Position of one component in a frame's memory.

    Args:
        offset: of the first row, in bytes.
        stride: from one row to the next, in bytes; at least the plane's width.
        rows: number of rows.
    """

    offset: int
    stride: int
    rows: int


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
        corrupt: whether the decoder concealed parts of it, because packets were lost.
        planes: luma, Cb, Cr in I420; else one.
        pixels: the memory.
        pixel_format: layout of the memory.
        decoder: GStreamer's element that decoded it.
    """

    width: int
    height: int
    codec: str
    pts_ns: int | None
    arrival_s: float
    corrupt: bool
    planes: tuple[Plane, ...] = field(repr=False)
    pixels: Pixels = field(repr=False)
    pixel_format: PixelFormat = PixelFormat.I420
    decoder: str = ""

    def plane(self, index: int) -> bytes:
        """Returns all rows of a plane, `planes[index].stride` bytes each (in I420 0 is luma, 1 Cb, 2 Cr)."""
        return self._rows(self.planes[index], 0, self.planes[index].rows)

    def luma_rows(self, first: int, count: int) -> bytes:
        """Returns rows of luma of an I420 frame, `planes[0].stride` bytes each, without copying the rest.

        Raises:
            IndexError: rows outside the frame.
        """
        if first < 0 or count < 0 or first + count > self.height:
            raise IndexError(f"rows {first} to {first + count} of a frame with {self.height}")
        return self._rows(self.planes[0], first, count)

    def _rows(self, plane: Plane, first: int, count: int) -> bytes:
        return self.pixels.extract_dup(plane.offset + first * plane.stride, count * plane.stride)
