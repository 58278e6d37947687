"""Options of a receiver: everything but the address."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from console.receiver.frame import PixelFormat
from console.receiver.recording import Recording


@dataclass(frozen=True, slots=True)
class ReceiverOptions:
    """Options of a receiver.

    Args:
        pixels: pixel format of the frames.
        decoders: GStreamer's element by codec ("h264", "h265"); a codec without one is decoded in software.
        recording: keeps the encoded stream, too; None records nothing.
    """

    pixels: PixelFormat = PixelFormat.I420
    decoders: Mapping[str, str] = field(default_factory=dict)
    recording: Recording | None = None
