"""Writes the encoded stream into a recording, beside the decoder."""

from itertools import pairwise
from typing import Any, Final

from console.receiver.decoding import element
from console.receiver.recording import Recording

_BACKLOG_BYTES: Final = 16 * 2**20
"""Bound of the queue for a slow disk: some 25 s of a stream at 5 Mbit/s. Beyond it the oldest is dropped."""


class FileBranch:
    """Hands the source's packets to a recording, without Python per packet.

    A slow disk does not delay the frames: its backlog waits in a queue of its own, and `fdsink`, unlike
    `filesink`, can be stopped while it blocks.

    Args:
        recording: takes the packets, and counts the gaps.

    Raises:
        UserError: an element is not installed.
    """

    def __init__(self, recording: Recording) -> None:
        self._tee = element("tee")
        self._queue = element(
            "queue", leaky="downstream", max_size_buffers=0, max_size_time=0, max_size_bytes=_BACKLOG_BYTES
        )
        self._handler = self._queue.connect("overrun", lambda _queue: recording.add_gap())
        self._sink = element("fdsink", fd=recording.pipe, sync=False)
        # The pipeline must not wait for the first packet here. `async` is a keyword of Python's.
        self._sink.set_property("async", False)

    def attach(self, pipeline: Any, source: Any) -> Any:
        """Adds the branch to a stopped pipeline; returns the element to link the decoder's branch to."""
        chain = (source, self._tee, self._queue, self._sink)
        for one in chain[1:]:
            pipeline.add(one)
        for upstream, downstream in pairwise(chain):
            upstream.link(downstream)
        return self._tee

    def detach(self) -> None:
        """Releases the stopped elements."""
        self._queue.disconnect(self._handler)
