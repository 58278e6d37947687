"""How a stream is to be received, apart from where it is."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from console.receiver.frame import PixelFormat
from console.receiver.recording import Recording


@dataclass(frozen=True, slots=True)
class Setup:
    """What a caller may want.

    Args:
        pixels: the form of the pictures.
        decoders: GStreamer's element by codec ("h264", "h265"); software for those not named.
        recording: keeps the stream as it comes; None keeps nothing.
    """

    pixels: PixelFormat = PixelFormat.I420
    decoders: Mapping[str, str] = field(default_factory=dict)
    recording: Recording | None = None
