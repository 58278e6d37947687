"""Frames without a decoder."""

from console.receiver.frame import Frame, Plane


class Memory:
    """Stands in for a Gst.Buffer and counts the bytes that are copied out of it."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        self.copied = 0

    def extract_dup(self, offset: int, size: int, /) -> bytes:
        self.copied += size
        return self._content[offset : offset + size]


def frame(number: int = 0) -> Frame:
    """A frame of 6 x 4 in rows of 8 bytes; `number` is its presentation time."""
    luma = bytes(range(32))
    chroma = bytes([128] * 8)
    return Frame(
        width=6,
        height=4,
        codec="h264",
        pts_ns=number,
        arrival_s=0.0,
        corrupt=False,
        planes=(Plane(0, 8, 4), Plane(32, 4, 2), Plane(40, 4, 2)),
        pixels=Memory(luma + chroma + chroma),
    )
