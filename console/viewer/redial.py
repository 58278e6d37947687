"""Decides which stream to connect to, and when to redial. Pure: no thread, no clock of its own."""

from typing import Final

from common.backoff import Backoff
from console.client.results import PreviewState, PreviewStatus, StreamContainer, StreamTransport
from console.receiver.address import StreamAddress

BLOCKED_PAUSE_S: Final = 5.0
"""Pause after an error that redialing can't fix, but the robot's administrator can."""
SILENCE_TIMEOUT_S: Final = 1.0
"""Longest silence after a frame. SRT itself takes 3.5 to 5 s to notice that its peer died silently."""
FIRST_FRAME_TIMEOUT_S: Final = 4.0
"""Longest wait for the first frame; longer than SRT's own connection timeout (SRTO_CONNTIMEO, 3 s)."""


def redial_backoff() -> Backoff:
    """Returns the pauses between connections, reset by a frame or when the preview begins to run.

    They are short, because one attempt lasts up to 3 s, and a listener that comes back meanwhile answers it.
    """
    return Backoff(first_s=0.1, longest_s=0.5)


def no_picture_backoff() -> Backoff:
    """Returns the pauses after connections that came about in vain; reset in the same way.

    Packets came over them, but no picture, or the receiver failed itself. They are longer: each connection
    begins with a key frame, which costs all viewers.
    """
    return Backoff(first_s=1.0, longest_s=5.0)


def address_of(preview: PreviewStatus) -> StreamAddress | None:
    """Returns the stream to connect to; None while the preview is off or its stream unknown.

    A faulted preview has an address, too: it restarts by itself, and its listener may be there before the
    gateway reports it.

    Raises:
        UserError: the robot's endpoint is not a valid address.
    """
    endpoint = preview.endpoint
    if endpoint is None or is_off(preview):
        return None
    if endpoint.transport is not StreamTransport.SRT or endpoint.container is not StreamContainer.MPEG_TS:
        return None
    return StreamAddress(
        endpoint.host, endpoint.port, endpoint.latency_ms, endpoint.passphrase, endpoint.capture_offset_ns
    )


def is_off(preview: PreviewStatus) -> bool:
    """Whether the preview is switched off, or being stopped."""
    return preview.state in (PreviewState.DISABLED, PreviewState.STOPPING)


def deadline_s(connected_s: float, frame_s: float | None) -> float:
    """Returns when a connection counts as lost.

    Args:
        connected_s: when it was begun.
        frame_s: when its latest frame came; None before the first.
    """
    return connected_s + FIRST_FRAME_TIMEOUT_S if frame_s is None else frame_s + SILENCE_TIMEOUT_S
