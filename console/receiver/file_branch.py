"""The way of the encoded stream into a file, beside the way to the decoder."""

from typing import Any, Final

from console.receiver.decoding import element
from console.receiver.recording import Recording

_BACKLOG_BYTES: Final = 16 * 2**20
"""What may wait for a slow disk: some 25 s of a stream at 5 Mbit/s. Then the oldest is left out."""


class FileBranch:
    """Appends what the source gives to a recording, packet by packet, without Python.

    Neither a slow nor a full disk reaches the pictures: what can't be written waits in a queue of its own,
    and an error in this branch ends the recording alone.

    Args:
        recording: the file, and whom to tell.

    Raises:
        UserError: an element is not installed.
    """

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._fork = element("tee")
        self._queue = element(
            "queue", leaky="downstream", max_size_buffers=0, max_size_time=0, max_size_bytes=_BACKLOG_BYTES
        )
        self._handler = self._queue.connect("overrun", lambda _queue: recording.leave_out())
        self._elements = [
            # Without it the queue would hand the file's error to the source, which would stop.
            element("errorignore", ignore_error=True, ignore_notlinked=True, convert_to="ok"),
            self._queue,
            element(
                "filesink",
                location=str(recording.file),
                append=True,
                buffer_mode="unbuffered",
                sync=False,
            ),
        ]
        self._elements[-1].set_property("async", False)

    def attach(self, pipeline: Any, source: Any) -> Any:
        """Joins a pipeline that does not run yet; returns the element to link the decoder's way to."""
        for one in (self._fork, *self._elements):
            pipeline.add(one)
        source.link(self._fork)
        for upstream, downstream in zip((self._fork, *self._elements), self._elements, strict=False):
            upstream.link(downstream)
        return self._fork

    def detach(self) -> None:
        """Lets go of the elements, which are stopped."""
        self._queue.disconnect(self._handler)

    def take_error(self, source: Any, text: str) -> bool:
        """Whether an error is this branch's own; then the recording is over."""
        mine = any(source is one for one in self._elements)
        if mine:
            self._recording.fail(text)
        return mine
