"""Options of a receiver: everything but the address."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, TypeAlias

from console.capture_time import CaptureClock
from console.receiver.delivery import DeliveryChoice
from console.receiver.frame import PixelFormat
from console.receiver.recording import Recording

RequestKeyFrame: TypeAlias = Callable[[int | None], bool]

MAX_AGE_S: Final = 0.6
CLOSES_WITHIN_S: Final = 2.0
"""A connection that takes longer to close hangs."""


@dataclass(frozen=True, slots=True)
class ReceiverOptions:
    """Options of a receiver.

    Args:
        pixels: pixel format of the frames.
        decoders: GStreamer's element by codec ("h264", "h265"); a codec without one is decoded in software.
        recording: keeps the encoded stream, too; None records nothing.
        delivery: how packets are delivered. What follows applies to direct delivery.
        capture: capture times of the stream's frames; None when they are not known.
        max_age_s: age of the frames beyond which the connection is made anew.
        on_picture_lost: requests a key frame, without which no further frame can be shown; called again while
            none comes. Takes the PTS of the newest frame of which anything has arrived, in ticks; returns
            whether a request is made. On the receiver's thread, so it must only hand over. Without it, or
            where no request is made, the connection is made anew.
        takes_requests: whether such a request still has a prospect; where it has not, the connection is made
            anew without waiting for the key frame.
    """

    pixels: PixelFormat = PixelFormat.I420
    decoders: Mapping[str, str] = field(default_factory=dict)
    recording: Recording | None = None
    delivery: DeliveryChoice = DeliveryChoice.AUTO
    capture: CaptureClock | None = None
    max_age_s: float = MAX_AGE_S
    on_picture_lost: RequestKeyFrame | None = None
    takes_requests: Callable[[], bool] = lambda: True
