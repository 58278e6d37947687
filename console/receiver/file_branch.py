"""Writes the encoded stream into a recording, beside the decoder."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any, Final

from console.receiver.decoding import element
from console.receiver.recording import Recording

_BACKLOG_BYTES: Final = 16 * 2**20
"""Bound of the queue for a slow disk: some 25 s of a stream at 5 Mbit/s. Beyond it the oldest is dropped."""


def add_file_branch(pipeline: Any, source: Any, recording: Recording) -> tuple[Any, Callable[[], None]]:
    """Hands the source's packets to a recording, without Python per packet.

    A slow disk does not delay the frames: its backlog waits in a queue of its own, and `fdsink`, unlike
    `filesink`, can be stopped while it blocks.

    Args:
        pipeline: is stopped.
        source: its element to record.
        recording: takes the packets, and counts the gaps.

    Returns:
        The element to link the decoder's branch to, and a function that releases the stopped elements.

    Raises:
        UserError: an element is not installed.
    """
    tee = element("tee")
    queue = element(
        "queue", leaky="downstream", max_size_buffers=0, max_size_time=0, max_size_bytes=_BACKLOG_BYTES
    )
    handler = queue.connect("overrun", lambda _queue: recording.add_gap())
    sink = element("fdsink", fd=recording.pipe, sync=False)
    # The pipeline must not wait for the first packet here. `async` is a keyword of Python's.
    sink.set_property("async", False)
    for upstream, downstream in pairwise((source, tee, queue, sink)):
        pipeline.add(downstream)
        upstream.link(downstream)
    return tee, lambda: queue.disconnect(handler)
