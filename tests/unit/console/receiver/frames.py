"""Frames without a decoder."""

from console.receiver.frame import Frame


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
        stride=8,
        read=lambda: luma + chroma + chroma,
    )
