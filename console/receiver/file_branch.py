"""The way of the encoded stream into a recording, beside the way to the decoder."""

from itertools import pairwise
from typing import Any, Final

from console.receiver.decoding import element
from console.receiver.recording import Recording

_BACKLOG_BYTES: Final = 16 * 2**20
"""What may wait for a slow disk: some 25 s of a stream at 5 Mbit/s. Then the oldest is left out."""


class FileBranch:
    """Hands what the source gives to a recording, packet by packet, without Python.

    A slow disk does not reach the pictures: what can't be handed over waits in a queue of its own, and
    `fdsink`, other than `filesink`, can be stopped while it waits.

    Args:
        recording: what keeps it, and whom to tell what was left out.

    Raises:
        UserError: an element is not installed.
    """

    def __init__(self, recording: Recording) -> None:
        self._fork = element("tee")
        self._queue = element(
            "queue", leaky="downstream", max_size_buffers=0, max_size_time=0, max_size_bytes=_BACKLOG_BYTES
        )
        self._handler = self._queue.connect("overrun", lambda _queue: recording.leave_out())
        self._sink = element("fdsink", fd=recording.pipe, sync=False)
        # The pipeline shall not wait for the first packet here. `async` is a word of Python's.
        self._sink.set_property("async", False)

    def attach(self, pipeline: Any, source: Any) -> Any:
        """Joins a pipeline that does not run yet; returns the element to link the decoder's way to."""
        chain = (source, self._fork, self._queue, self._sink)
        for one in chain[1:]:
            pipeline.add(one)
        for upstream, downstream in pairwise(chain):
            upstream.link(downstream)
        return self._fork

    def detach(self) -> None:
        """Lets go of the elements, which are stopped."""
        self._queue.disconnect(self._handler)
